"""Export of a network: as a file of weights, or as an ONNX graph, which runs without pcsr and torch."""

import copy
import json
import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor, nn

from pcsr import __version__
from pcsr.contracts import Fusion, TouchBatch
from pcsr.errors import UserError
from pcsr.extras import imported, require
from pcsr.files import write_whole
from pcsr.network.load import save_weights
from pcsr.network.network import Network
from pcsr.recipe import Recipe
from pcsr.upsample.candidates import Networked

if TYPE_CHECKING:
    from pcsr.model import Model

USER = "exporting a graph"
"""What needs the extra `[onnx]`, in a message."""
FRAME = "centred on the mean of the points, the farthest of them at distance 1; the same for the touches"
LOGGERS = ("torch.onnx", "onnxscript", "onnx_ir")
"""Loggers of the exporter, which are silenced."""


def export_weights(model: "Model", path: str | Path, *, half: bool = False) -> None:
    """Write the weights of a model with their card, to be distributed.

    Args:
        model: result of `pcsr.load`.
        path: the file; it is written whole or not at all.
        half: write half precision, in half the space. `pcsr.load` converts it to single precision.

    Raises:
        UserError: there is no network, the path is a folder, or a weight is too large for half precision.
        RunError: the file can't be written.
    """
    path = Path(path)
    network, recipe = _exportable(model, path, "weights.safetensors")
    save_weights(path, network, {"recipe": recipe.resolved(), **model.card}, half=half)


def export_onnx(
    model: "Model",
    path: str | Path,
    *,
    points: int | None = None,
    touches: int = 0,
    touch_points: int | None = None,
    batch: int | None = None,
) -> dict[str, tuple[int | str, ...]]:
    """Write the network of a model as an ONNX graph, with its weights in it.

    Inputs `points` (b n 3) and, if there are touches, `touches` (b a m 3), both float32, in the unit sphere of the
    points (`pcsr.geometry.frames.UnitSphere`); output `dense` (b rate·n 3) in the same frame. All sizes but the
    batch's are fixed. The file's metadata holds the recipe and the card of the weights.

    Args:
        model: result of `pcsr.load`; it is not changed.
        path: the file; it is written whole or not at all.
        points: n, number of points of a cloud; as in training by default.
        touches: a, number of touches of each cloud.
        touch_points: m, number of points of each touch; as in training by default.
        batch: number of clouds in a batch; any number by default.

    Returns:
        Shapes of the inputs and, last, of the output; "b" stands for any size.

    Raises:
        UserError: the extra `[onnx]` is not installed, there is no network, an invalid number, or a network that
            cannot be exported; the message says why.
    """
    require(dict.fromkeys(("onnx", "onnxscript"), USER))
    path = Path(path)
    network, recipe = _exportable(model, path, "model.onnx")
    trained = Networked.of(network, recipe)
    points = trained.size if points is None else points
    touch_points = trained.touch_points if touch_points is None else touch_points
    _check(model.name, network.fusion, trained.most_touches, points, touches, touch_points, batch)
    example = [torch.zeros(batch or 2, points, 3)]
    if touches:
        example.append(torch.zeros(batch or 2, touches, touch_points, 3))
    graph = _graph(model.name, _Fixed(network, recipe).eval(), tuple(example), fixed=batch is not None)
    about = {
        "pcsr.version": __version__,
        "pcsr.recipe": json.dumps(recipe.resolved()),
        "pcsr.card": json.dumps(model.card),
        "pcsr.frame": FRAME,
    }
    content = _clean(graph, about).SerializeToString()
    write_whole(path, lambda part: _write(part, content))
    size = "b" if batch is None else batch
    inputs = {"points": (size, points, 3)} | ({"touches": (size, touches, touch_points, 3)} if touches else {})
    return {**inputs, "dense": (size, trained.rate * points, 3)}


def _exportable(model: "Model", path: Path, example: str) -> tuple[Network, Recipe]:
    """Network and recipe of a model, if they can be written to a path."""
    if model.network is None or model.recipe is None:
        raise UserError(f"model '{model.name}' is no network, so there is nothing to export: name weights")
    if path.is_dir():
        raise UserError(f"{path} is a folder: name the file to write, such as {path / example}")
    return model.network, model.recipe


def _check(
    name: str, fusion: Fusion, most_touches: int, points: int, touches: int, touch_points: int, batch: int | None
) -> None:
    """Refuse sizes that no graph can have, or not one of this network."""
    numbers = {"points": points, "touch_points": touch_points, "batch": 1 if batch is None else batch}
    for what, number in numbers.items():
        if number < 1:
            raise UserError(f"{what} is {number}: it must be 1 or more")
    if not 0 <= touches <= most_touches:
        raise UserError(f"touches is {touches}: '{name}' was trained with at most {most_touches}, so give 0 to that")
    if touches and type(fusion).join is not Fusion.join:
        raise UserError(
            f"the fusion of '{name}' joins the touches to the cloud, which is then thinned in a way that ONNX does not "
            f"know: export it without touches"
        )


def _write(part: Path, content: bytes) -> None:
    part.write_bytes(content)


class _Fixed(nn.Module):
    """A copy of a network on the CPU with a fixed rate, since inputs of a graph are tensors."""

    def __init__(self, network: Network, recipe: Recipe) -> None:
        super().__init__()
        self.network = copy.deepcopy(network).cpu().float().requires_grad_(False)
        self.rate = recipe.network_rate

    def forward(self, points: Tensor, touches: Tensor | None = None) -> Tensor:
        dense: Tensor = self.network(points, self.rate, None if touches is None else TouchBatch.of(touches))
        return dense


def _graph(name: str, network: nn.Module, example: tuple[Tensor, ...], *, fixed: bool) -> Any:
    """The graph as an `onnx.ModelProto`.

    Raises:
        UserError: the extra is missing, or the exporter fails.
    """
    translations = _translations()
    size = torch.export.Dim("batch", min=1)
    try:
        with _quiet(), torch.no_grad():
            program = torch.onnx.export(
                network,
                example,
                dynamo=True,
                verbose=False,
                input_names=["points", "touches"][: len(example)],
                output_names=["dense"],
                dynamic_shapes=None if fixed else tuple({0: size} for _ in example),
                custom_translation_table=translations,
            )
    except Exception as error:  # parts and the exporter may raise any error
        first = _first(error)
        if isinstance(first, UserError):
            raise first from error
        said = next(iter(str(first).strip().splitlines()), "") or type(first).__name__
        raise UserError(f"the network of '{name}' cannot be written as ONNX: {said}") from error
    if program is None:
        raise UserError(f"the network of '{name}' cannot be written as ONNX by torch {torch.__version__}: update it")
    graph = program.model_proto
    # If a part needs a fixed size of the batch, the exporter silently takes the example's.
    if not fixed and not all(given.type.tensor_type.shape.dim[0].dim_param for given in graph.graph.input):
        raise UserError(f"the network of '{name}' takes no batches of any size: fix it (batch=1, or --batch 1)")
    return graph


def _first(error: BaseException) -> BaseException:
    """The first cause of an error."""
    while error.__cause__ is not None:
        error = error.__cause__
    return error


@contextmanager
def _quiet() -> Iterator[None]:
    loggers = [logging.getLogger(name) for name in LOGGERS]
    levels = [logger.level for logger in loggers]
    try:
        for logger in loggers:
            logger.setLevel(logging.ERROR)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def _translations() -> dict[Callable[..., Any], Callable[..., Any]]:
    """Operators of torch that its exporter lacks, in operators of ONNX.

    Raises:
        UserError: the extra `[onnx]` is not installed.
    """
    op = imported("onnxscript", USER).opset18

    def sort(values: Any, stable: bool = False, dim: int = -1, descending: bool = False) -> Any:  # noqa: ARG001
        # TopK is stable: among equals the lower index comes first.
        count = op.Gather(op.Shape(values), op.Constant(value_ints=[dim]))
        return op.TopK(values, count, axis=dim, largest=int(descending), sorted=1)

    def cdist(one: Any, other: Any, p: float = 2.0, mode: int | None = None) -> Any:  # noqa: ARG001
        if p != 2:
            raise UserError(f"distances of order {p:g} are not translated to ONNX: use order 2")
        offsets = op.Sub(
            op.Unsqueeze(one, op.Constant(value_ints=[-2])), op.Unsqueeze(other, op.Constant(value_ints=[-3]))
        )
        return op.ReduceL2(offsets, op.Constant(value_ints=[-1]), keepdims=0)

    return {torch.ops.aten.sort.stable: sort, torch.ops.aten._cdist_forward.default: cdist}


def _clean(graph: Any, about: dict[str, str]) -> Any:
    """Replace the metadata of a graph, since the exporter's contains paths of this machine."""
    inner = graph.graph
    for thing in (inner, *inner.node, *inner.value_info, *inner.input, *inner.output, *inner.initializer):
        del thing.metadata_props[:]
        thing.doc_string = ""
    del graph.metadata_props[:]
    for key, value in about.items():
        graph.metadata_props.add(key=key, value=value)
    graph.producer_name, graph.producer_version, graph.doc_string = "pcsr", __version__, ""
    return graph
