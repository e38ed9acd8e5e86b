"""Relocalisation: where in a whole map a robot is that has no place."""
