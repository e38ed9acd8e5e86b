"""What a start needs: compiled kernels, and a segmenter with its engine."""
