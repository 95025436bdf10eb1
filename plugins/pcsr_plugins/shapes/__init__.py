"""Shapes: where the objects come from."""
