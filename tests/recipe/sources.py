"""Sources of recipes that were not read from a file."""

import copy

from pcsr.recipe.source import Location, Source


def source(tree, origin="file"):
    """Return a source whose values are all located in a file of this name."""
    made = Source(copy.deepcopy(tree), {(): Location(origin)})

    def note(keys, node):
        for key, value in node.items() if isinstance(node, dict) else ():
            made.values[(*keys, key)] = made.names[(*keys, key)] = Location(origin)
            note((*keys, key), value)

    note((), tree)
    return made
