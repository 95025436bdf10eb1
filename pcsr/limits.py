"""Limits of what is read: sizes that no honest file reaches, and the memory that is free."""

from contextlib import suppress
from pathlib import Path

from pcsr.errors import UserError

LARGEST_FILE = 1 << 34
"""Bytes of the largest file that is read: 16 GiB. Files that need more memory than is free are refused before."""
LARGEST_PIPE = 1 << 32
"""Bytes that are read from a pipe at most: 4 GiB. A pipe does not say in advance how much will come."""
LARGEST_JSON = 1 << 25
"""Bytes of the largest JSON that is parsed: 32 MiB. 10,000 grasps of four fingers take some 25 MB."""
LONGEST_LINE = 1 << 20
"""Bytes of the longest line of a text file: 1 MiB, some 50,000 numbers."""
MOST_COLUMNS = 4096
"""Numbers that a text file may have for each point, the coordinates included."""
MOST_PIXELS = 1 << 24
"""Pixels of the largest image of a touch: 16.8 million, twice as many as a GelSight Mini's camera has."""
MOST_TOUCHES = 10_000
"""Touches of one recording: five times as many as `pcsr touch` makes at most."""
MOST_FINGERS = 1_000
"""Fingers of one grasp."""
MOST_TOUCHED_POINTS = 10**8
"""Points of all touches of one recording: 2.4 GB."""
RATIO = 100
"""A file that is compressed becomes at most so many times larger than it is: points shrink to a tenth at best."""
FREELY = 1 << 27
"""Bytes that are never too many, whatever they were compressed from or however little memory is free: 128 MiB."""


def gigabytes(count: int | float) -> str:
    """A number of bytes in words: "1.5 GB"."""
    return f"{count / 1e9:.3g} GB" if count >= 1e8 else f"{count / 1e6:.3g} MB"


def free_memory() -> int | None:
    """Bytes that this process may still take; None where the system does not say.

    The least of what the machine has left, what the container or batch job may take, and what `ulimit -v` leaves.
    """
    found = []
    with suppress(OSError, ValueError, LookupError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        table = {name: int(rest.split()[0]) << 10 for name, _, rest in (line.partition(":") for line in lines)}
        found.append(table["MemAvailable"] + table.get("SwapFree", 0))
    with suppress(OSError, ValueError, LookupError):
        most = int(Path("/sys/fs/cgroup/memory.max").read_text())  # "max", where there is none, is no number
        words = Path("/sys/fs/cgroup/memory.stat").read_text().split()
        found.append(most - int(words[words.index("anon") + 1]))
    with suppress(ImportError, OSError, ValueError):
        import resource

        most = resource.getrlimit(resource.RLIMIT_AS)[0]
        if most != resource.RLIM_INFINITY:
            found.append(most - int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize())
    return max(0, min(found)) if found else None


def check_memory(needed: int | float, name: str) -> None:
    """Refuse what does not fit into the memory that is free.

    Args:
        needed: bytes that reading it takes, about.
        name: what is read, with its size: "big.ply (7 GB)".

    Raises:
        UserError: there is not so much memory.
    """
    free = free_memory() if needed > FREELY else None
    if free is not None and needed > free:
        raise UserError(
            f"{name} needs about {gigabytes(needed)} of memory, and {gigabytes(free)} are free: "
            f"split it, or take a machine with more memory"
        )


def check_inflated(packed: int, inflated: int) -> None:
    """Refuse compressed data that claim to become far larger than points can.

    Args:
        packed: bytes that the file has.
        inflated: bytes that they are said to become.

    Raises:
        UserError: they are too many for the file, or for the memory that is free.
    """
    if inflated > FREELY and inflated > RATIO * packed:
        raise UserError(
            f"its {gigabytes(packed)} would become {gigabytes(inflated)}, more than {RATIO} times as much, "
            f"which no cloud does: get the file again, or save it uncompressed"
        )
    check_memory(inflated, f"what it holds ({gigabytes(inflated)})")
