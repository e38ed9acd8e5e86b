"""Benchmarks of the planner beside its peers."""
