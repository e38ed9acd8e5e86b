"""The map as a value and as a file, and the prior map."""
