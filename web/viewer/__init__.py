"""3D view of the robot's world, and clicks in it."""
