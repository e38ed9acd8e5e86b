"""Tracking: one estimate per frame, from odometry, scans and absolute positions."""
