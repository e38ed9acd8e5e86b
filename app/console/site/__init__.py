"""The sites of a running console, and the map of the one in use."""
