"""What a recipe may say: its sections as pydantic models; each part's options, read off its constructor."""

import hashlib
import inspect
import json
import re
import typing
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, create_model

from pcsr.plugins.guard import guarded
from pcsr.plugins.registry import Registry
from pcsr.recipe.old_names import as_in_0_1

NAME = r"^[a-z0-9][a-z0-9.-]{0,199}$"
"""Of a run: with its fingerprint it is the name of a folder, and those have up to 255 characters everywhere."""
AS_TUPLE = BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value)
"""YAML has lists only; a value that must not change is a tuple."""

MOST_TRUTH = 1 << 20
"""Points of an object's truth: a minute and 2 GB for each object."""
MOST_RAYS = 1 << 24
"""Lines of sight of all depth cameras on an object: a minute and 2 GB."""


class Section(BaseModel):
    """A part of a recipe that knows its keys: an unknown one is a mistake."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class PartSpec(Section):
    """A part by name with its options; once checked, all of its options."""

    use: str
    options: dict[str, Any] = Field(default_factory=dict)

    def build(self, registry: Registry, kind: str, *host: Any) -> Any:
        """An instance of the part; `host` is what the host hands in, such as `Widths`."""
        part = registry.get(kind, self.use)
        with guarded(f"the constructor of {kind} '{self.use}'"):
            return part(*host, **self.options)

    def needs(self, registry: Registry, kind: str) -> dict[str, str]:
        """The packages that the part needs, and its name, as `pcsr.extras.require` takes them."""
        return dict.fromkeys(sorted(registry.get(kind, self.use).needs), f"{kind} '{self.use}'")


class View(Section):
    """The simulated depth camera of `sampling: view`."""

    cameras: Annotated[int, Field(ge=1, le=64)] = 1
    """Viewpoints, drawn for each object; surface that none of them sees is missing."""
    noise: Annotated[float, Field(ge=0, le=1)] = 0.0
    """Standard deviation along the line of sight, in radii of the object."""
    distance: Annotated[float, Field(gt=1, le=1000)] = 3.0
    """From the camera to the object's middle, in radii of the object."""
    pixels: Annotated[int, Field(ge=8, le=4096)] = 160
    """Along each side of the image, which just holds the object."""


class Data(Section):
    """The objects, their clouds and their touches."""

    shapes: PartSpec
    touch: PartSpec
    touches: Annotated[int, Field(ge=0, le=16)] = 4
    """Touches of each object at evaluation."""
    points: Annotated[int, Field(ge=16, le=MOST_TRUTH)] = 512
    """Points of the sparse cloud."""
    rate: Annotated[int, Field(ge=1, le=64)] = 16
    """Points of the truth for each of them."""
    truth: Literal["poisson", "fps"] = "poisson"
    """How the truth is drawn from the surface: blue noise, or farthest points."""
    sampling: Literal["random", "poisson", "fps", "view", "mixed"] = "random"
    """How the sparse cloud is drawn from the truth; `view`: seen by a depth camera instead; `mixed`: each of these for
    a quarter of the objects."""
    view: View = View()
    seed: Annotated[int, Field(ge=0, lt=2**32)] | None = None
    """None: the recipe's. With one of its own the data stays the same under other seeds of the training."""


class Model(Section):
    """The parts of the network."""

    encoder: PartSpec
    touch_encoder: PartSpec | None = None
    fusion: PartSpec
    backbone: PartSpec
    upsampler: PartSpec


Count = Annotated[int, Field(ge=0, le=16)]
FEW = Field(max_length=16)
"""A list of names, none of them twice."""
Augmentation = Literal["rotate", "scale", "jitter", "redraw", "even", "crop"]


class Train(Section):
    """How the network is trained."""

    objective: PartSpec
    epochs: Annotated[int, Field(ge=1, le=1_000_000)] = 300
    batch: Annotated[int, Field(ge=1, le=65_536)] = 32
    optimizer: Literal["adam", "adamw"] = "adam"
    learning_rate: Annotated[float, Field(gt=0)] = 1e-3
    """Learning rate of the first epoch."""
    decay: Annotated[float, Field(gt=0, le=1)] = 0.7
    """Factor of the learning rate every `decay_every` epochs."""
    decay_every: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    """None: a tenth of the epochs."""
    augment: Annotated[tuple[Augmentation, ...], AS_TUPLE, FEW] = ("redraw", "even", "rotate", "scale", "jitter")
    touches: Count | Annotated[tuple[Count, Count], AS_TUPLE] | None = None
    """One number, or the least and the most, drawn for each batch; None: as at evaluation."""
    precision: Literal["32-true", "bf16-mixed"] = "32-true"


class Evaluate(Section):
    """What is measured, and beside what."""

    metrics: Annotated[tuple[str, ...], AS_TUPLE, Field(min_length=1), FEW] = ("cd", "hd", "emd")
    """Registered metrics by name."""
    baselines: Annotated[tuple[str, ...], AS_TUPLE, FEW] = ("midpoint",)
    """Registered baselines; wins are counted against the first. `midpoint`: interpolation; `floor`: the true surface,
    sampled once more and independently of the truth: the least error that any upsampler can expect."""
    objects: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    """The first so many of the test split; None: all."""
    examples: Annotated[int, Field(ge=0, le=16)] = 4
    """Objects that the report shows."""
    published: Annotated[dict[str, float], Field(max_length=64)] = Field(default_factory=dict)
    """What a publication says of this network: metrics times 10³, `s/cloud`, `s/epoch`; tables show it beside ours."""


class Patches(Section):
    """The field's protocol: small patches, each seen alone, merged and thinned by farthest points."""

    points: Annotated[int, Field(ge=16, le=65_536)] = 256
    """Points of a patch."""
    rate: Annotated[int, Field(ge=2, le=64)] = 4
    """Points that the network makes of each. To reach the rate of the data it is applied again to what it made."""
    overlap: Annotated[float, Field(ge=1, le=16)] = 3.0
    """In how many patches a point is, in the mean."""


class Weights(Section):
    """Weights that are evaluated instead of training."""

    use: Annotated[str, Field(min_length=1, max_length=4096)]
    """The name of shipped ones, or a file."""
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    """Of the file. It is filled in where a recipe is read; one that is written is held against the file."""


def _named(name: str) -> str:
    if not re.fullmatch(NAME, name):
        raise ValueError("it must be up to 200 of a-z, 0-9, . and -, the first a letter or a digit")
    return name


class Recipe(Section):
    """Everything that decides a run."""

    name: Annotated[str, AfterValidator(_named), Field(json_schema_extra={"pattern": NAME})]
    """It names the run's folder."""
    seed: Annotated[int, Field(ge=0, lt=2**32)] = 0
    data: Data
    model: Model
    patches: Patches | None = None
    """None: the whole cloud in one pass, as TAPSR does it."""
    train: Train
    weights: Weights | None = None
    """Evaluated instead of training; None: the network is trained. What `train` says is then how they were."""
    joined: Annotated[tuple[str, ...], AS_TUPLE, Field(max_length=1_000)] = ()
    """The fingerprints of the folders, where the data is that of several (`--data`)."""
    evaluate: Evaluate = Evaluate()
    code: dict[str, str] = Field(default_factory=dict)
    """By the place of a part, such as `model.fusion`, a hash of the code of the plugin that brings it; of a part of
    pcsr its version from 2 on. It is filled in where a recipe is read, whatever is written."""

    @property
    def network_points(self) -> int:
        """Points of a cloud as the network sees it."""
        return self.patches.points if self.patches else self.data.points

    @property
    def network_rate(self) -> int:
        """Points that the network makes of each."""
        return self.patches.rate if self.patches else self.data.rate

    @property
    def touch_range(self) -> tuple[int, int]:
        """Fewest and most touches in training."""
        touches = self.train.touches
        if touches is None:
            touches = self.data.touches
        return (touches, touches) if isinstance(touches, int) else touches

    @property
    def most_touches(self) -> int:
        """Touches that each object of the data must have."""
        return max(self.touch_range[1], self.data.touches)

    def resolved(self) -> dict[str, Any]:
        """Plain data with every default filled in, in the form of a recipe file."""
        plain: dict[str, Any] = {key: _flat(value) for key, value in self.model_dump(mode="json").items()}
        if not self.code:
            del plain["code"]
        return plain

    @property
    def fingerprint(self) -> str:
        """Hash of all that decides the weights: neither the name nor the evaluation does."""
        return _hash(self._decisive() | ({"code": self.code} if self.code else {}))

    @property
    def settings_fingerprint(self) -> str:
        """The fingerprint without the code of the parts: that of runs of this recipe before a plugin was edited."""
        return _hash(self._decisive())

    def _decisive(self) -> dict[str, Any]:
        plain = as_in_0_1(self.resolved())
        data = {key: value for key, value in plain["data"].items() if key != "touches"}
        decisive: dict[str, Any] = {"seed": self.seed, "data": data, "model": plain["model"]}
        if self.weights:
            decisive["weights"] = self.weights.sha256
        else:
            decisive["train"] = plain["train"] | {"touches": list(self.touch_range)}
        if self.joined:
            decisive["joined"] = plain["joined"]
        if self.patches:
            decisive["patches"] = plain["patches"] | {"cover": None}
        return decisive

    def measured_on_meshes(self, registry: Registry) -> list[str]:
        """The metrics and baselines that need the true surfaces, beside the clouds of the data."""
        named = (*(("metric", name) for name in self.evaluate.metrics),)
        named += (*(("baseline", name) for name in self.evaluate.baselines),)
        return [name for kind, name in named if registry.get(kind, name).needs_mesh]

    @property
    def data_seed(self) -> int:
        """The seed of everything random in the data."""
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
"""Parts that need not be named. A recipe without a `model` gets that of `tapsr`; one with a model names its parts."""


def _flat(node: Any) -> Any:
    """`{use, options: {…}}` to the form that people write: `{use, …}`."""
    if isinstance(node, dict):
        if node.keys() == {"use", "options"}:
            return {"use": node["use"], **node["options"]}
        return {key: _flat(value) for key, value in node.items()}
    return node


def _hash(plain: Any) -> str:
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()


def options_model(part: type) -> type[BaseModel]:
    """The options of a part as a model: the keyword-only parameters of its constructor.

    Their types are what YAML can write: bool, int, float, str, Literal, None, lists, tuples and mappings of
    these, with pydantic's constraints as `Annotated`. It is strict, and made for `model_validate_json`: JSON
    knows no tuples, so a list is taken for one there.

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
