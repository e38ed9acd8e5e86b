"""The 3D view: what of the robot's world is drawn, and what a click in it means."""
