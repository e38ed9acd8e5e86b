"""The pose graph: edges between keyframes, and their solution by graduated non-convexity."""
