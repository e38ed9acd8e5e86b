"""Models of the mission: goals, settings of the path, driving by hand."""
