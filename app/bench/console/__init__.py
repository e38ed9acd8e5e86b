"""Benchmarks of the console: the page in Chromium, the 3D view, latency, and long drives."""
