"""Plugins: how they are found and loaded, and the registry of the parts that they bring."""
