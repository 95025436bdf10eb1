"""Networks without touch, whose result gets the touched points afterwards.

The touched points replace the generated points around them, as with a fusion that keeps touched points; features, and
so all other points of a pass, stay as they are. What a graft achieves beyond this, it owes to its training.
"""

from pcsr import Widths
from pcsr.data.dataset import Split
from pcsr.experiments.evaluation import evaluate
from pcsr.experiments.methods import methods
from pcsr.network.load import load_weights
from pcsr.network.network import Network
from pcsr.plugins.registry import Registry
from pcsr.results import Results, read_results, write_results
from pcsr.run_files import FinishedRun
from pcsr.weights import WEIGHTS

MEASURED = "inserted.json"
FUSION = "joint-cloud"
"""Fusion without weights that keeps touched points, and at inference does nothing else."""


def inserted(alone: FinishedRun, touched: FinishedRun, registry: Registry) -> FinishedRun:
    """Measure a network without touch on the objects of a run with touches, whose touched points are inserted.

    The results are kept in the run folder of the network, and measured again if its weights or the data change.

    Args:
        alone: run of the network without touch.
        touched: run on the same objects with touches; its data set is beside its folder.
        registry: installed parts.

    Raises:
        UserError: weights, data or the kept results are missing or malformed.
    """
    path = alone.folder / MEASURED
    if path.exists():
        known = read_results(path)
        if (known.training.weights, known.data) == (alone.results.training.weights, touched.results.data):
            return FinishedRun(alone.folder, known, [], alone.history)
    results = _measured(alone, touched, registry)
    write_results(path, results)
    return FinishedRun(alone.folder, results, [], alone.history)


def _measured(alone: FinishedRun, touched: FinishedRun, registry: Registry) -> Results:
    network, of_network, _ = load_weights(alone.folder / WEIGHTS, registry)
    of_touched = load_weights(touched.folder / WEIGHTS, registry)[1]
    assert isinstance(network, Network)
    fusion = registry.get("fusion", FUSION)(Widths())
    network = Network(network.encoder, None, fusion, network.backbone, network.upsampler).eval()
    recipe = of_network.model_copy(update={"data": of_touched.data, "evaluate": of_touched.evaluate})
    folder = touched.folder.parent / "data" / touched.results.data.fingerprint[:12]
    split = Split.load(folder, "test").spread(len(touched.results.objects))
    made = evaluate(recipe, registry, methods(recipe, network, registry)[:1], split, jobs=1)
    settings = alone.results.recipe
    changed = {
        "name": f"{alone.results.name}-inserted",
        "recipe": settings
        | {
            "model": settings["model"] | {"fusion": {"use": FUSION}},
            "evaluate": settings.get("evaluate", {}) | {"published": {}},
        },
        "data": touched.results.data,
        "methods": made.methods,
        "touch": made.touch,
    }
    return alone.results.model_copy(update=changed)
