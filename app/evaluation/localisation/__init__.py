"""Evaluation of localisation on recorded drives, judged by the true poses."""
