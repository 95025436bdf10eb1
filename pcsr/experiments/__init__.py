"""Runs of recipes: training, evaluation, and the files of a run folder."""
