"""Interactive HTML pages: of a run, of several runs, and of a data set."""
