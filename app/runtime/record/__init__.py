"""What is kept of a drive: the map, measurements, reports."""
