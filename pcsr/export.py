"""Export of a model's network as a file of weights, or as an ONNX graph that runs without pcsr and torch."""

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

from pcsr.contracts import Fusion, TouchBatch
from pcsr.errors import UserError
from pcsr.extras import imported, require
from pcsr.files import write_whole
from pcsr.network.kinds import AnyNetwork
from pcsr.network.save import save_weights
from pcsr.recipe import Recipe
from pcsr.upsample.candidates import Networked
from pcsr.version import __version__
from pcsr.weights import WEIGHTS

if TYPE_CHECKING:
    from pcsr.model import Model

USER = "exporting a graph"
"""Feature that needs the extra `[onnx]`, for the message if it is not installed."""
FRAME = "centred on the mean of the points, the farthest of them at distance 1; the same for the touches"
"""Description of the frame of inputs and output, which is written into the graph's metadata."""
LOGGERS = ("torch.onnx", "onnxscript", "onnx_ir")
"""Loggers of the exporter, which are silenced: their messages are meant for its developers."""


def export_weights(model: "Model", path: str | Path, *, half: bool = False) -> None:
    """Write the weights of a model with their card, for distribution.

    Args:
        model: model of `pcsr.load`.
        path: the file; it is written completely or not at all.
        half: whether to write half precision, which takes half the space. `pcsr.load` converts it to single precision.

    Raises:
        UserError: there is no network, the path is a folder, or a weight is too large for half precision.
        RunError: the file can't be written.

    Examples:
        >>> pcsr.export_weights(pcsr.load("tapsr"), "half.safetensors", half=True)
        >>> pcsr.load("half.safetensors").name
        'half.safetensors'
    """
    path = Path(path)
    network, recipe = _exportable(model, path, WEIGHTS)
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
    """Write the network of a model as an ONNX graph with its weights.

    The inputs are `points` (b n 3) and, with touches, `touches` (b a m 3), both float32 and in the unit sphere of the
    points (`pcsr.geometry.frames.UnitSphere`). The output is `dense` (b rate·n 3) in the same frame. All sizes but b
    are fixed. The metadata of the file contains the recipe and the card of the weights.

    Args:
        model: model of `pcsr.load`; it is not changed.
        path: the file; it is written completely or not at all.
        points: n, number of points of a cloud; as in training by default.
        touches: a, number of touches of each cloud.
        touch_points: m, number of points of each touch; as in training by default.
        batch: b, number of clouds in a batch; any by default.

    Returns:
        Shapes of the inputs and, as last item, of the output, by name; "b" stands for any size.

    Raises:
        UserError: the extra `[onnx]` is not installed, there is no network, an invalid number, or a network that
            cannot be exported; the message says why.

    Examples:
        >>> pcsr.export_onnx(pcsr.load("tapsr"), "tapsr.onnx", points=64, batch=1)
        {'points': (1, 64, 3), 'dense': (1, 1024, 3)}
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


def _exportable(model: "Model", path: Path, example: str) -> tuple[AnyNetwork, Recipe]:
    """Return the network of a model and its recipe.

    Raises:
        UserError: the model has no network, or the path is a folder.
    """
    if model.network is None or model.recipe is None:
        raise UserError(
            f"model '{model.name}' has no network, so there is nothing to export: load a model with weights"
        )
    if path.is_dir():
        raise UserError(f"{path} is a folder: name the file to write, such as {path / example}")
    return model.network, model.recipe


def _check(
    name: str, fusion: Fusion, most_touches: int, points: int, touches: int, touch_points: int, batch: int | None
) -> None:
    """Check the sizes of a graph.

    Raises:
        UserError: a size is out of range, or the network does not support touches in a graph.
    """
    numbers = {"points": points, "touch_points": touch_points, "batch": 1 if batch is None else batch}
    for what, number in numbers.items():
        if number < 1:
            raise UserError(f"{what} is {number}: it must be 1 or more")
    if not 0 <= touches <= most_touches:
        raise UserError(
            f"touches is {touches}: '{name}' was trained with at most {most_touches}: give 0 to {most_touches}"
        )
    if touches and type(fusion).join is not Fusion.join:
        raise UserError(
            f"the fusion of '{name}' adds the touched points to the cloud, whose subsampling ONNX does not support: "
            f"export it without touches"
        )


def _write(part: Path, content: bytes) -> None:
    part.write_bytes(content)


class _Fixed(nn.Module):
    """Copy of a network on the CPU with a fixed rate, since an input of a graph must be a tensor."""

    def __init__(self, network: AnyNetwork, recipe: Recipe) -> None:
        super().__init__()
        self.network = copy.deepcopy(network).cpu().float().requires_grad_(False)
        self.rate = recipe.network_rate

    def forward(self, points: Tensor, touches: Tensor | None = None) -> Tensor:
        dense: Tensor = self.network(points, self.rate, None if touches is None else TouchBatch.of(touches))
        return dense


def _graph(name: str, network: nn.Module, example: tuple[Tensor, ...], *, fixed: bool) -> Any:
    """Export a network as an `onnx.ModelProto`.

    Raises:
        UserError: the extra `[onnx]` is not installed, or the exporter fails.
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
    except Exception as error:  # parts and the exporter may raise anything
        first = _first_cause(error)
        if isinstance(first, UserError):
            raise first from error
        reason = next(iter(str(first).strip().splitlines()), "") or type(first).__name__
        raise UserError(f"the network of '{name}' cannot be written as ONNX: {reason}") from error
    if program is None:
        raise UserError(f"the network of '{name}' cannot be written as ONNX by torch {torch.__version__}: update it")
    graph = program.model_proto
    # If a part needs a fixed batch size, the exporter silently fixes that of the example.
    if not fixed and not all(each.type.tensor_type.shape.dim[0].dim_param for each in graph.graph.input):
        raise UserError(f"the network of '{name}' needs a fixed batch size: give one (batch=1, or --batch 1)")
    return graph


def _first_cause(error: BaseException) -> BaseException:
    """Return the error at the beginning of a chain of errors."""
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
    """Return implementations in ONNX operators for operators that torch's exporter lacks.

    Raises:
        UserError: the extra `[onnx]` is not installed.
    """
    op = imported("onnxscript", USER).opset18

    def sort(values: Any, stable: bool = False, dim: int = -1, descending: bool = False) -> Any:  # noqa: ARG001
        # TopK puts the lower index first among equal values, so that it sorts stably.
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
    """Replace the metadata of a graph by that of pcsr; the exporter's contains paths of this machine."""
    inner = graph.graph
    for each in (inner, *inner.node, *inner.value_info, *inner.input, *inner.output, *inner.initializer):
        del each.metadata_props[:]
        each.doc_string = ""
    del graph.metadata_props[:]
    for key, value in about.items():
        graph.metadata_props.add(key=key, value=value)
    graph.producer_name, graph.producer_version, graph.doc_string = "pcsr", __version__, ""
    return graph
