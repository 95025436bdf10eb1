"""Families of generated parts: one function each, grouped by how such parts are made."""
