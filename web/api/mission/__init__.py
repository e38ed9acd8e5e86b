"""Routes of the mission: goals, start and stop, driving by hand, settings of the path."""
