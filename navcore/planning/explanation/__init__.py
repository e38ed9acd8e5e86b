"""Why the path leads where it does, and what would have to go for one to exist."""
