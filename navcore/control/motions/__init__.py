"""The motions that the local planner chooses from, one file each."""
