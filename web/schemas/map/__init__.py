"""Models of the map: its tiles, edits of it, poses."""
