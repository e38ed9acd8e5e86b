"""The navigation core: from an RGB-D frame and the operator's rules to a velocity."""
