"""The network: parts in a row, built from a recipe, saved and loaded."""
