"""Finder of weights files: by name, file, run folder, or repository on the Hugging Face hub."""

import os
from collections.abc import Sequence
from pathlib import Path

from pcsr.errors import UserError, did_you_mean
from pcsr.extras import imported
from pcsr.validation_messages import shown, shown_path
from pcsr.weights import WEIGHTS, names, shipped

RESULTS = "results.json"
"""File of a run folder that was evaluated."""


def find(
    use: str, folder: Path = Path(), *, paths_first: bool = False, hub: bool = False, others: Sequence[str] = ()
) -> Path:
    """Find a weights file.

    Args:
        use: name of shipped weights, a file, or a run folder.
        folder: folder to which paths are relative.
        paths_first: whether a file or run folder takes precedence over shipped weights of the same name.
        hub: whether `org/name` may be a repository on the Hugging Face hub.
        others: other valid names, for the hint in the message.

    Raises:
        UserError: there are no such weights, or the folder holds none.
    """
    # Unlike pathlib, os.path treats unknown users and impossible names as missing files.
    path = folder / Path(os.path.expanduser(use))
    there = os.path.exists(path)
    if use in names() and not (paths_first and there):
        return shipped(use)
    if os.path.isdir(path):
        return _of_folder(path)
    if there:
        return path
    if hub and use.count("/") == 1 and not path.suffix and not os.path.exists(path.parent):
        return _from_hub(use)
    hint = did_you_mean(use, [*others, *names()])
    raise UserError(
        f"there are no weights {shown(use)}, neither shipped ones nor a file or run folder {shown_path(path)}: {hint}"
    )


def _of_folder(folder: Path) -> Path:
    """Return the weights of a run folder.

    Rows of a study that differ in the number of touches at evaluation are of one network. Its weights are in the folder
    of the row that trained it.

    Raises:
        UserError: there are none.
    """
    if os.path.isfile(folder / WEIGHTS):
        return folder / WEIGHTS
    if os.path.isfile(folder / RESULTS):
        from pcsr.results import read_results
        from pcsr.weights.file import read_card  # imports torch

        results = read_results(folder / RESULTS)
        wanted = (results.fingerprint, results.data.fingerprint)
        for path in sorted(folder.parent.glob(f"*-{results.fingerprint[:8]}/{WEIGHTS}")):
            card = read_card(path)
            if (card.get("fingerprint"), card.get("data_fingerprint")) == wanted:
                return path
        raise UserError(
            f"{folder} holds no {WEIGHTS}, and {folder.parent} none of another run of its recipe: name a weights file"
        )
    raise UserError(
        f"{folder} is a folder, not a weights file, and holds no {WEIGHTS}: name a file, or the folder of a finished "
        f"run"
    )


def _from_hub(name: str) -> Path:
    """Return the weights file of a repository on the hub, and download it unless it is cached."""
    hub = imported("huggingface_hub", f"model '{name}' (no file has this name, but the Hugging Face hub may know it)")
    try:
        return Path(hub.hf_hub_download(name, WEIGHTS))
    except Exception as error:  # the network and the hub raise errors of many kinds
        raise UserError(f"model '{name}' cannot be fetched from the hub: {str(error).splitlines()[0]}") from error
