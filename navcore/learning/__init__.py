"""How the segmentation is taught and how well it learned."""
