"""Logs of real laser scanners: localisation alone follows them."""
