"""Points: their table, the looks that make and unmake them, and the poses they belong to."""
