"""`python -m app.evaluation.tables` rewrites the tables of results; a test compares them."""

from app.evaluation.tables.pages import rewrite

rewrite()
