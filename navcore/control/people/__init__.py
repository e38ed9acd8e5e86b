"""People near the robot: where they may come to, and the rules beside them."""
