"""`Model.upsample` on parts that one camera saw: what exact touches of the other side are worth, used as they are.

python benchmarks/hidden_side.py [MODEL…] [--touches 4] [--save]

Parts, cameras and touches are those of pcsr/recipes/touch/occlusion.yaml with policy `sparse`, the test split.
"""

from collections.abc import Sequence
from pathlib import Path

import click
import numpy as np
from rich.progress import track
from saved import save, show

import pcsr
from pcsr.contracts import ShapeItem
from pcsr.data.sample import Sample, make_sample
from pcsr.errors import PcsrError, UserError
from pcsr.model import INTERPOLATION
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr.weights import DEFAULT

RECIPE = Path(__file__).parents[1] / "pcsr/recipes" / "touch" / "occlusion.yaml"


def samples(touches: int, settings: Sequence[str]) -> list[Sample]:
    """The test parts of the recipe's row of policy `sparse` and so many touches."""
    registry = load_plugins()
    rows = [row for row in load(RECIPE, registry, settings) if row.data.touches == touches]
    recipe = next((row for row in rows if row.data.touch.options["policy"].use == "sparse"), None)
    if recipe is None:
        raise UserError("--set leaves no row of policy 'sparse': the other side is where the cloud is sparse")
    shapes = recipe.data.shapes.build(registry, "shapes")
    source = recipe.data.touch.build(registry, "touch")

    def sample(item: ShapeItem) -> Sample:
        return make_sample(item, source, recipe.data, recipe.data.touches, recipe.data_seed)

    return [sample(shapes.item(name)) for name in track(shapes.names("test"), "parts", transient=True)]


def errors(model: pcsr.Model, parts: Sequence[Sample], touches: int) -> np.ndarray:
    """The Chamfer distance of each part, ×10³."""
    found = []
    for part in track(parts, f"{model.name}, {touches} touches", transient=True):
        dense = model.upsample(part.points, list(part.touches[:touches]), count=len(part.truth))
        found.append(1e3 * pcsr.evaluate(dense, part.truth, frame="none", metrics="cd")["cd"])
    return np.array(found)


@click.command()
@click.argument("models", nargs=-1)
@click.option("--touches", type=click.IntRange(1, 5), default=4, show_default=True)
@click.option("--set", "settings", multiple=True, metavar="KEY=VALUE", help="Change the recipe.")
@click.option("--save", "saving", is_flag=True, help="Write docs/numbers/hidden-side.json.")
def main(models: Sequence[str], touches: int, settings: Sequence[str], saving: bool) -> None:
    """Print a row for each model: its error without touches, and with."""
    try:
        parts = samples(touches, settings)
        columns, rows = ("model", "cd ×10³ without touch", f"{touches} touches", "better"), []
        for name in models or (DEFAULT, INTERPOLATION):
            model = pcsr.load(name)
            plain, touched = (errors(model, parts, count) for count in (0, touches))
            spread = (f"{values.mean():.2f} ± {values.std(ddof=1):.2f}" for values in (plain, touched))
            rows.append([f"`{name}`", *spread, f"{(touched < plain).sum()}/{len(parts)}"])
    except PcsrError as error:
        raise click.ClickException(str(error)) from error
    show(columns, rows)
    if saving:
        save("hidden-side", f"python benchmarks/hidden_side.py {' '.join(models)} --save", columns, rows)


if __name__ == "__main__":
    main()
