"""A recipe to results: training, evaluation, and what a run leaves in its folder."""
