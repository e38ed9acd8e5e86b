"""The tables of results in the pages, made from the kept files in `app/evaluation/results`."""
