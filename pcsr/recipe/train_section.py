"""The section `train` of a recipe."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from pcsr.options import Choice
from pcsr.recipe.section import AS_TUPLE, FEW, PartSpec, Section

Count = Annotated[int, Field(ge=0, le=16)]
Epochs = Annotated[int, Field(ge=1, le=1_000_000)]
Augmentation = Literal["rotate", "scale", "jitter", "redraw", "even", "crop", "noise", "uneven", "other-touches"]


def _named(written: Any) -> Any:
    """Return the specification for a bare name, as cards of pcsr 0.2 have it."""
    return {"use": written} if isinstance(written, str) else written


class Weights(Section):
    """Finished weights."""

    use: Annotated[str, Field(min_length=1, max_length=4096)]
    """Name of shipped weights, or path of a file."""
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    """SHA-256 hash of the file. It is filled in when a recipe is read; a hash in the recipe must match the file."""


class Average(Choice):
    """Average of the weights over the steps, which is evaluated and kept instead of the weights of the last step."""

    use: Literal["ema", "swa"]
    """Exponential moving average, or the mean of all steps from `start` on (stochastic weight averaging)."""
    decay: Annotated[float, Field(gt=0, lt=1)] | None = None
    """Weight of the previous average in that of `ema`. None: 0.999."""
    start: Annotated[int, Field(ge=0)] | None = None
    """Number of epochs before the average begins. None: 0 for `ema`, three quarters of the epochs for `swa`."""


class Train(Section):
    """Training of the network."""

    objective: PartSpec
    epochs: Epochs = 300
    batch: Annotated[int, Field(ge=1, le=65_536)] = 32
    optimizer: Annotated[PartSpec, BeforeValidator(_named)] = PartSpec(use="adam")
    """Class of `torch.optim` in lower case, with those of its options that differ from torch's defaults."""
    learning_rate: Annotated[float, Field(gt=0)] = 1e-3
    """Learning rate of the first epoch, or after `warmup`."""
    schedule: Literal["steps", "cosine", "linear"] = "steps"
    """Decrease of the learning rate: in steps, or to `final_learning_rate` along half a cosine or a straight line."""
    decay: Annotated[float, Field(gt=0, le=1)] = 0.7
    """Factor of the learning rate every `decay_every` epochs, with `steps`."""
    decay_every: Epochs | None = None
    """Number of epochs between two decays. None: a tenth of the epochs."""
    final_learning_rate: Annotated[float, Field(ge=0)] = 0.0
    """Learning rate at the end of the training, with `cosine` and `linear`."""
    warmup: Annotated[float, Field(ge=0)] = 0.0
    """Number of epochs, whole or not, over which the learning rate rises linearly from 0."""
    clip_norm: Annotated[float, Field(gt=0)] | None = None
    """Largest norm of the gradient of network and objective together; longer ones are scaled to it. None: any."""
    average: Average | None = None
    """Average of the weights. None: the weights of the last step."""
    augment: Annotated[tuple[Augmentation, ...], AS_TUPLE, FEW] = ("redraw", "even", "rotate", "scale", "jitter")
    touches: Count | Annotated[tuple[Count, Count], AS_TUPLE] | None = None
    """Number of touches in training, or the least and the greatest, between which it is drawn for each batch. None: the
    number at evaluation."""
    precision: Literal["32-true", "bf16-mixed"] = "32-true"
    validate_every: Epochs | None = None
    """Number of epochs between two validations. None: a tenth of the epochs."""
    patience: Annotated[int, Field(ge=1)] | None = None
    """Number of validations without a lower error after which training ends (early stopping). The weights of the lowest
    error are kept. None: all epochs are trained, and the last weights are kept."""
    snapshots: Annotated[tuple[Annotated[int, Field(ge=1)], ...], AS_TUPLE, FEW] = ()
    """Steps after which the weights are kept, each as a weights file `weights-STEP.safetensors` of the run folder."""
    start: Weights | None = None
    """Weights that training starts from: tensors that the network has too, by name and shape. None: random weights."""
    loggers: Annotated[tuple[PartSpec, ...], AS_TUPLE, FEW] = (PartSpec(use="jsonl"),)
    """Loggers of the training. They do not belong to the fingerprint."""
