"""Terrain: slope, steps and roughness of the ground, kept for each cell over time."""
