"""What the robot is to do: goals, saved missions, zones, settings of the path."""
