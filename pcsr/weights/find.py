"""The weights file that a name, a file, a run folder or the Hugging Face hub stands for."""

import os
from collections.abc import Sequence
from pathlib import Path

from pcsr.errors import UserError, did_you_mean
from pcsr.extras import imported
from pcsr.validation_messages import shown, shown_path
from pcsr.weights import WEIGHTS, names, shipped


def find(
    use: str, folder: Path = Path(), *, paths_first: bool = False, hub: bool = False, others: Sequence[str] = ()
) -> Path:
    """The weights file that a text stands for.

    Args:
        use: the name of shipped weights, a file, or a run folder.
        folder: the folder that paths are relative to.
        paths_first: whether a file or run folder goes before shipped weights of the same name.
        hub: whether `org/name` may be a repository on the Hugging Face hub.
        others: names that the caller knows besides, for the hint in the message.

    Raises:
        UserError: there is no such file, or the folder holds no weights.
    """
    # These two take a user that isn't there, and a name that no file can have, for a file that isn't there.
    path = folder / Path(os.path.expanduser(use))
    there = os.path.exists(path)
    if use in names() and not (paths_first and there):
        return shipped(use)
    if os.path.isdir(path):
        if not os.path.isfile(path / WEIGHTS):
            raise UserError(
                f"{path} is a folder, not a weights file, and holds no {WEIGHTS}: name a file, or the folder of a "
                f"finished run"
            )
        return path / WEIGHTS
    if there:
        return path
    if hub and use.count("/") == 1 and not path.suffix and not os.path.exists(path.parent):
        return _from_hub(use)
    hint = did_you_mean(use, [*others, *names()])
    raise UserError(
        f"there are no weights {shown(use)}, neither shipped ones nor a file or run folder {shown_path(path)}: {hint}"
    )


def _from_hub(name: str) -> Path:
    """The weights file of a repository on the hub, downloaded if need be."""
    hub = imported("huggingface_hub", f"model '{name}' (no file has this name, but the Hugging Face hub may know it)")
    try:
        return Path(hub.hf_hub_download(name, WEIGHTS))
    except Exception as error:  # whatever the network and the hub may say
        raise UserError(f"model '{name}' cannot be fetched from the hub: {str(error).splitlines()[0]}") from error
