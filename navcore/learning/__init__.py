"""Training and evaluation of the segmentation network."""
