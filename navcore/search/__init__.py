"""Exact grid search on packed bits: what `navcore.path` is made of. Nothing outside the planner needs more than `Replanner`."""
