"""Routes of the map: its tiles and files, edits of it, and the robot's position on it."""
