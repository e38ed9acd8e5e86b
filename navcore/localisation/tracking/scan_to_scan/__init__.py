"""The newest scan against those before it, without a map: motion, pushes, being carried away."""
