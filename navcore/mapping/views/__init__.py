"""Views: the cells and heights that one image measures, and the points it adds to the map."""
