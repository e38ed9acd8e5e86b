"""Models of the beware list and of teaching."""
