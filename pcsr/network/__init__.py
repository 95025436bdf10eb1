"""Networks: building from a recipe, saving and loading."""
