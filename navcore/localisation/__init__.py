"""Where the robot is: map → odom → base (REP 105), by odometry, scans of the depth camera against
the robot's own map, and absolute positions."""
