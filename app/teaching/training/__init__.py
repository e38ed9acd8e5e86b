"""Training runs: planned, run in a process of their own, watched and compared."""
