"""The robot controller and the threads that drive it."""
