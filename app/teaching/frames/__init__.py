"""Captured frames: what is stored of them, and their annotation."""
