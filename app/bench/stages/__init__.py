"""Benchmarks of single stages: the tick, corrections of the map, training."""
