"""Schema of recipes: pydantic models of the sections, and of each part's options from its constructor."""

import hashlib
import inspect
import json
import re
import typing
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Discriminator, Field, Tag, create_model

from pcsr.clouds.pose_error import MOST_POSITION, MOST_ROTATION
from pcsr.plugins.registry import Registry
from pcsr.recipe.graft_section import Graft
from pcsr.recipe.old_names import as_in_0_1
from pcsr.recipe.section import AS_TUPLE, FEW, PartSpec, Section
from pcsr.recipe.train_section import Train, Weights
from pcsr.weights import SHA256_IN_0_1

NAME = r"^[a-z0-9][a-z0-9._-]{0,199}$"
"""Pattern of a run's name. Run folders are named by it and the fingerprint, and folder names have 255 characters."""
MOST_TRUTH = 1 << 20
"""Largest number of points of an object's truth. It takes a minute and 2 GB for each object."""
MOST_RAYS = 1 << 24
"""Largest number of rays of all depth cameras of an object. It takes a minute and 2 GB."""


class View(Section):
    """Simulated depth cameras of `sampling: view`."""

    cameras: Annotated[int, Field(ge=1, le=64)] = 1
    """Number of viewpoints, drawn for each object. Surface that no camera sees is missing from the cloud."""
    noise: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Standard deviation along the line of sight, in radii of the object."""
    distance: Annotated[float, Field(gt=1, le=1000)] = 3.0
    """Distance from the camera to the object's centre, in radii of the object."""
    pixels: Annotated[int, Field(ge=8, le=4096)] = 160
    """Side of the square image, in pixels. The image just covers the object."""


class Registration(Section):
    """Registration of the touches to the sparse cloud, with the expected error of the poses that the robot reports."""

    position: Annotated[float, Field(ge=0, le=MOST_POSITION)] = 1.0
    """Standard deviation along each axis, in millimetres."""
    rotation: Annotated[float, Field(ge=0, le=MOST_ROTATION)] = 2.0
    """Standard deviation about each axis, in degrees."""


class Data(Section):
    """Data: objects, their clouds and their touches."""

    shapes: PartSpec
    touch: PartSpec
    touches: Annotated[int, Field(ge=0, le=16)] = 4
    """Number of touches of each object at evaluation."""
    points: Annotated[int, Field(ge=16, le=MOST_TRUTH)] = 512
    """Number of points of the sparse cloud."""
    rate: Annotated[int, Field(ge=1, le=64)] = 16
    """Number of points of the truth per point of the sparse cloud."""
    truth: Literal["poisson", "fps"] = "poisson"
    """Sampling of the truth on the surface: Poisson disk (blue noise) or farthest points."""
    sampling: Literal["random", "poisson", "fps", "view", "mixed"] = "random"
    """Sampling of the sparse cloud: a subset of the truth, or the points that depth cameras see (`view`). With `mixed`,
    each of the four is used for a quarter of the objects."""
    view: View = View()
    registration: Registration | None = None
    """Registration of the touches to the sparse cloud (`pcsr.registration`). A touch that cannot be registered is left
    out, so that objects may have fewer touches than `touches`. None: touches are where the robot reports them."""
    seed: Annotated[int, Field(ge=0, lt=2**32)] | None = None
    """Seed of the data. With a seed here, the data does not change with the seed of the training. None: the recipe's
    seed."""


class Model(Section):
    """Parts of the network."""

    encoder: PartSpec
    touch_encoder: PartSpec | None = None
    fusion: PartSpec
    backbone: PartSpec
    upsampler: PartSpec


class GraftedModel(Section):
    """A foreign network with touch at one of its layers, in place of the parts of a network."""

    graft: Graft


PARTS_TAG, GRAFT_TAG = "network of parts", "grafted network"
"""Names of the two kinds of models, which pydantic adds to the keys of an error."""


def _kind_of_model(written: Any) -> str:
    is_graft = "graft" in written if isinstance(written, dict) else isinstance(written, GraftedModel)
    return GRAFT_TAG if is_graft else PARTS_TAG


AnyModel = Annotated[
    Annotated[Model, Tag(PARTS_TAG)] | Annotated[GraftedModel, Tag(GRAFT_TAG)], Discriminator(_kind_of_model)
]
"""The model of a recipe: the parts of a network, or a graft."""


class Evaluate(Section):
    """Evaluation: metrics and baselines."""

    metrics: Annotated[tuple[str, ...], AS_TUPLE, Field(min_length=1), FEW] = ("cd", "hd", "emd")
    """Names of registered metrics."""
    baselines: Annotated[tuple[str, ...], AS_TUPLE, FEW] = ("midpoint",)
    """Names of registered baselines. Wins are counted against the first. `midpoint` is interpolation. `floor` is
    another sample of the true surface, independent of the truth: the lowest error that an upsampler can expect."""
    objects: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    """Number of evaluated objects, the first of the test split. None: all."""
    examples: Annotated[int, Field(ge=0, le=16)] = 4
    """Number of objects that the report shows."""
    published: Annotated[dict[str, float], Field(max_length=64)] = Field(default_factory=dict)
    """Published values of this network for the tables: metrics times 10³, `s/cloud` and `s/epoch`."""


class Patches(Section):
    """Patch-wise upsampling: patches are upsampled one by one, merged, and subsampled with farthest points."""

    points: Annotated[int, Field(ge=16, le=65_536)] = 256
    """Number of points of a patch."""
    rate: Annotated[int, Field(ge=2, le=64)] = 4
    """Upsampling rate of one pass. The network is applied repeatedly until the rate of the data is reached."""
    overlap: Annotated[float, Field(ge=1, le=16)] = 3.0
    """Mean number of patches that contain a point."""


def _named(name: str) -> str:
    if not re.fullmatch(NAME, name):
        raise ValueError("it must be up to 200 of a-z, 0-9, ., _ and -, the first a letter or a digit")
    return name


class Recipe(Section):
    """Recipe of a run."""

    name: Annotated[str, AfterValidator(_named), Field(json_schema_extra={"pattern": NAME})]
    """Name of the run and its folder."""
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    data: Data
    model: AnyModel
    patches: Patches | None = None
    """Patch-wise upsampling. None: as `pcsr upsample`, or the whole cloud in one pass if the network is of one rate."""
    train: Train
    weights: Weights | None = None
    """Weights to evaluate instead of training; `train` then describes their training. None: the network is trained."""
    joined: Annotated[tuple[str, ...], AS_TUPLE, Field(max_length=1_000)] = ()
    """Fingerprints of the data folders, if several are joined (`--data`)."""
    evaluate: Evaluate = Evaluate()
    code: dict[str, str] = Field(default_factory=dict)
    """Identifiers of the code of the parts by their keys, such as `model.fusion`: a hash of the plugin's files, or the
    version, from 2 on, of a part of pcsr. They are filled in when a recipe is read; what the file says is ignored."""

    @property
    def network_points(self) -> int:
        """Number of points of the network's input cloud."""
        return self.patches.points if self.patches else self.data.points

    @property
    def network_rate(self) -> int:
        """Upsampling rate of one pass of the network."""
        return self.patches.rate if self.patches else self.data.rate

    @property
    def touch_range(self) -> tuple[int, int]:
        """Least and greatest number of touches in training."""
        touches = self.train.touches
        if touches is None:
            touches = self.data.touches
        return (touches, touches) if isinstance(touches, int) else touches

    @property
    def most_touches(self) -> int:
        """Number of touches that each object of the data must have."""
        return max(self.touch_range[1], self.data.touches)

    def resolved(self) -> dict[str, Any]:
        """Return the recipe as plain data, in the form of a recipe file, with all defaults."""
        plain: dict[str, Any] = {key: _flat(value) for key, value in self.model_dump(mode="json").items()}
        if not self.code:
            del plain["code"]
        return plain

    @property
    def fingerprint(self) -> str:
        """Hash of everything that determines the weights, which excludes the name and the evaluation."""
        return _hash(self._decisive() | ({"code": self.code} if self.code else {}))

    @property
    def settings_fingerprint(self) -> str:
        """Fingerprint without the code of the parts. It does not change when a plugin is edited."""
        return _hash(self._decisive())

    def _decisive(self) -> dict[str, Any]:
        plain = as_in_0_1(self.resolved())
        data = {key: value for key, value in plain["data"].items() if key != "touches"}
        decisive: dict[str, Any] = {"seed": self.seed, "data": data, "model": plain["model"]}
        if isinstance(self.model, GraftedModel) and self.model.graft.weights:
            decisive["model"]["graft"]["weights"] = self.model.graft.weights.sha256
        if self.weights:
            decisive["weights"] = SHA256_IN_0_1.get(self.weights.sha256, self.weights.sha256)
        else:
            decisive["train"] = plain["train"] | {"touches": list(self.touch_range)}
            if self.train.start:
                decisive["train"]["start"] = self.train.start.sha256
        if self.joined:
            decisive["joined"] = plain["joined"]
        if self.patches:
            decisive["patches"] = plain["patches"] | {"cover": None}
        return decisive

    def measured_on_meshes(self, registry: Registry) -> list[str]:
        """Return the names of the metrics and baselines that need the true surface of the objects."""
        named = (*(("metric", name) for name in self.evaluate.metrics),)
        named += (*(("baseline", name) for name in self.evaluate.baselines),)
        return [name for kind, name in named if registry.get(kind, name).needs_mesh]

    @property
    def data_seed(self) -> int:
        """Seed of the data."""
        return self.seed if self.data.seed is None else self.data.seed


DEFAULTS: dict[str, Any] = {
    "data": {"shapes": {"use": "cad-parts"}, "touch": {"use": "digit"}},
    "model": {
        "encoder": {"use": "unet", "channels": 128},
        "touch_encoder": {"use": "unet", "channels": 32},
        "fusion": {"use": "iterative"},
        "backbone": {"use": "pu-transformer"},
        "upsampler": {"use": "shuffle", "start": "neighbours"},
    },
    "train": {"objective": {"use": "chamfer"}},
}
"""Default parts. A recipe without a `model` has that of `tapsr`; a `model` must name all of its parts."""
GRAFT_DEFAULTS: dict[str, Any] = {"fusion": {"use": "iterative"}, "touch_encoder": {"use": "unet", "channels": 32}}
"""Default tactile parts of a graft."""


def _flat(node: Any) -> Any:
    """Convert `{use, options: {…}}` to the form of recipe files, `{use, …}`."""
    if isinstance(node, dict):
        if node.keys() == {"use", "options"}:
            return {"use": node["use"], **node["options"]}
        return {key: _flat(value) for key, value in node.items()}
    return [_flat(value) for value in node] if isinstance(node, list) else node


def _hash(plain: Any) -> str:
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()


def options_model(part: type) -> type[BaseModel]:
    """Return the model of a part's options, which are the keyword-only parameters of its constructor.

    Options may be of any type that YAML can express: bool, int, float, str, Literal, None, and lists, tuples and
    mappings of these, with pydantic's constraints as `Annotated`. The model is strict. Validate with
    `model_validate_json`, which accepts a list for a tuple, since JSON has no tuples.

    Raises:
        TypeError: a parameter has no type.
    """
    hints = typing.get_type_hints(part.__init__, include_extras=True)  # type: ignore[misc]
    fields: dict[str, Any] = {}
    for name, parameter in inspect.signature(part.__init__).parameters.items():  # type: ignore[misc]
        if parameter.kind is not parameter.KEYWORD_ONLY:
            continue
        if name not in hints:
            raise TypeError(f"option '{name}' of {part.__name__} has no type: annotate it in its constructor")
        default = ... if parameter.default is parameter.empty else parameter.default
        fields[name] = (hints[name], default)
    config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, protected_namespaces=())
    return create_model(part.__name__, __config__=config, **fields)
