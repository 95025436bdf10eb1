"""The name of a foreign network in a recipe."""

import re

NETWORK = re.compile(r"(?P<file>[^/\\:]{1,200}\.py):(?P<name>[A-Za-z_]\w{0,99}(\.[A-Za-z_]\w{0,99})*)")
"""Pattern of a network in a resolved recipe: the name of a Python file without its folder, and that of a class in it,
or of a function that returns the network."""
