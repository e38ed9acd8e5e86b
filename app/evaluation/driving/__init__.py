"""Suites of missions: worlds, doors, people who cross, the BARN worlds, the range of the view."""
