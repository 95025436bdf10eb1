"""Limits on the size of inputs, and checks against the free memory."""

from contextlib import suppress
from pathlib import Path

from pcsr.errors import UserError

LARGEST_FILE = 1 << 34
"""Largest size of a file: 16 GiB. A file that needs more than the free memory is refused whatever its size."""
LARGEST_PIPE = 1 << 32
"""Largest size of a pipe's content: 4 GiB. The size is not known before the end is reached."""
LARGEST_JSON = 1 << 25
"""Largest size of a JSON document: 32 MiB. 10,000 grasps of four fingers take about 25 MB."""
LONGEST_LINE = 1 << 20
"""Longest line of a text file: 1 MiB, about 50,000 numbers."""
MOST_COLUMNS = 4096
"""Largest number of columns of a cloud, the coordinates included."""
MOST_PIXELS = 1 << 24
"""Most pixels of an image of a touch: 16.8 million, twice as many as the camera of a GelSight Mini has."""
MOST_TOUCHES = 10_000
"""Most touches of a recording: five times as many as `pcsr touch` simulates at most."""
MOST_FINGERS = 1_000
"""Most fingers of a grasp."""
MOST_TOUCHED_POINTS = 10**8
"""Most points of all touches of a recording together: 2.4 GB."""
MOST_INFLATION = 100
"""Largest ratio of decompressed to compressed size. Clouds reach about 10."""
UNCHECKED_SIZE = 1 << 27
"""Sizes up to 128 MiB are accepted whatever the compression ratio and the free memory."""


def gigabytes(count: int | float) -> str:
    """Format a number of bytes, such as "1.5 GB"."""
    for unit, size in (("GB", 1e9), ("MB", 1e6)):
        if count >= size / 10:
            return f"{count / size:.3g} {unit}"
    return f"{count / 1e3:.3g} kB"


def free_memory() -> int | None:
    """Return the number of bytes that this process can still allocate; None where the system does not report it.

    This is the smallest of the machine's available memory, the rest of the control group's limit (containers, batch
    jobs), and the rest of the address space limit (`ulimit -v`).
    """
    found = []
    with suppress(OSError, ValueError, LookupError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        table = {name: int(rest.split()[0]) << 10 for name, _, rest in (line.partition(":") for line in lines)}
        found.append(table["MemAvailable"] + table.get("SwapFree", 0))
    with suppress(OSError, ValueError, LookupError):
        most = int(Path("/sys/fs/cgroup/memory.max").read_text())  # a ValueError for "max", which means no limit
        words = Path("/sys/fs/cgroup/memory.stat").read_text().split()
        found.append(most - int(words[words.index("anon") + 1]))
    with suppress(ImportError, OSError, ValueError):
        import resource

        most = resource.getrlimit(resource.RLIMIT_AS)[0]
        if most != resource.RLIM_INFINITY:
            found.append(most - int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize())
    return max(0, min(found)) if found else None


def check_memory(needed: int | float, name: str, remedy: str = "split it, or use a machine with more memory") -> None:
    """Check that an input fits into the free memory.

    Args:
        needed: approximate number of bytes that reading the input takes.
        name: name and size of the input for the error message: "big.ply (7 GB)".
        remedy: what to do otherwise.

    Raises:
        UserError: less memory is free.
    """
    free = free_memory() if needed > UNCHECKED_SIZE else None
    if free is not None and needed > free:
        raise UserError(f"{name} needs about {gigabytes(needed)} of memory, and {gigabytes(free)} are free: {remedy}")


def check_inflated(packed: int, inflated: int) -> None:
    """Check the declared size of compressed data before it is decompressed.

    Args:
        packed: size of the file in bytes.
        inflated: declared size after decompression in bytes.

    Raises:
        UserError: the ratio of the two is larger than `MOST_INFLATION`, or the free memory is too small.
    """
    if inflated > UNCHECKED_SIZE and inflated > MOST_INFLATION * packed:
        raise UserError(
            f"its {gigabytes(packed)} would become {gigabytes(inflated)}, more than {MOST_INFLATION} times as much, "
            f"which no cloud does: get the file again, or save it uncompressed"
        )
    check_memory(inflated, f"its content ({gigabytes(inflated)})")
