"""What the body would touch on a motion."""
