"""Policies: where to touch next."""
