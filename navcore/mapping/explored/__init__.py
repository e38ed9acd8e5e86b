"""Explored cells: what was measured, seen across or driven on, by the pose it was explored from."""
