"""The beware list of a running console: edits, colour rules, classes by example."""
