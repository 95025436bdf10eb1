"""Pickled arrays of recordings, read without running anything that they name."""
