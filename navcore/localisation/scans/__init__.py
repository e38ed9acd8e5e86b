"""Scans: surface points of one view, their sums on a map, and the match of one with the other."""
