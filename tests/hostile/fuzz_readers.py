"""Fuzzing of all readers: valid files are damaged, and whatever reads them must refuse them or take them.

    python tests/hostile/fuzz_readers.py --minutes 60 --seed 7 --keep findings/

A finding is an exception that is no `UserError` or `RunError`, a warning of another library, anything on stderr, a
message of more than 2,000 letters, or an input that takes too many seconds or megabytes. It is printed with the command
that repeats it, its input is kept, and the exit code is 1.

The mutator is plain and seeded. What matters here are numbers that name sizes, in a dozen formats: mutations that know
those find more in a minute than coverage of the Python code does, as most of the decoding is in compiled libraries;
hypothesis would shrink and remember, but makes some hundred inputs a second of much smaller files.
"""

import argparse
import faulthandler
import importlib
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path

SECONDS = 10.0
"""Of the processor that one input may take: on a busy machine the clock would count others."""
MEGABYTES = 600
"""By which the process may grow for one input."""
ADDRESSES = 12 << 30
LONGEST = 2000
"""Letters of the longest message."""


def attempt(seed, folder, stderr):
    """Read one input; what is wrong with how it went, or None."""
    from pcsr.errors import PcsrError, PcsrWarning

    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    start, said = time.process_time(), None
    faulthandler.dump_traceback_later(SECONDS * 6, exit=True)
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        try:
            seed.read(folder)
        except PcsrError as error:
            if len(str(error)) > LONGEST and str(error).count("\n") < 2:
                said = f"a message of {len(str(error))} letters: {str(error)[:200]}"
        except BaseException as error:
            if isinstance(error, KeyboardInterrupt):
                raise
            said = "".join(traceback.format_exception(error)[-8:])
    faulthandler.cancel_dump_traceback_later()
    seconds = time.process_time() - start
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    warned = [one for one in warned if not issubclass(one.category, PcsrWarning)]  # of what was left out
    if said is None and warned:
        said = f"warning: {warned[0].category.__name__}: {warned[0].message} ({warned[0].filename}:{warned[0].lineno})"
    if said is None and stderr.has_new():
        said = f"on stderr: {stderr.last[:300]}"
    if said is None and seconds > SECONDS:
        said = f"{seconds:.1f} seconds"
    if said is None and grown > MEGABYTES:
        said = f"{grown:.0f} megabytes"
    return said


class Stderr:
    """What anything, compiled libraries included, wrote to stderr, which goes into a file meanwhile."""

    def __init__(self, path):
        self.file = path.open("w+b")
        self.at, self.last = 0, ""
        os.dup2(self.file.fileno(), 2)

    def has_new(self):
        self.file.seek(self.at)
        self.last = self.file.read().decode(errors="replace")
        self.at += len(self.last)
        return bool(self.last)


def work(options):
    resource.setrlimit(resource.RLIMIT_AS, (ADDRESSES, ADDRESSES))
    sys.path.insert(0, str(Path(__file__).parent))
    mutations, made = importlib.import_module("mutations"), importlib.import_module("seeds")

    seeds = [seed for name, kind in made.KINDS.items() if name in options.kinds for seed in kind()]
    folder, stderr = options.folder / "input", Stderr(options.folder / "stderr")
    for seed in seeds:
        put(folder, seed.files)
        if not seed.refused:
            seed.read(folder)
    stderr.has_new()
    start, index, found = time.monotonic(), options.index or 0, {}
    while time.monotonic() - start < options.minutes * 60:
        rng = random.Random(f"{options.seed}/{index}")
        seed, other = rng.choice(seeds), rng.choice(seeds)
        name = rng.choice(list(seed.files))
        same = next(iter(other.files.values()))
        put(folder, seed.files | {name: mutations.mutated(name, seed.files[name], rng, same)})
        (options.folder / "index").write_text(f"{index} {seed.name} {name}")
        said = attempt(seed, folder, stderr)
        if said is not None:
            key = said[-150:]
            found[key] = found.get(key, 0) + 1
            if found[key] == 1:
                report(options, index, seed.name, name, said)
        if options.index is not None:
            break
        index += 1
    seconds = time.monotonic() - start
    say(f"{index} inputs of {len(seeds)} seeds in {seconds:.0f} s, {len(found)} findings")
    (options.folder / "done").touch()
    return 1 if found else 0


def put(folder, files):
    shutil.rmtree(folder, ignore_errors=True)
    for name, data in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)


def report(options, index, seed, name, said):
    say(f"FOUND in {seed}, {name}: --seed {options.seed} --index {index}\n{said}")
    if options.keep:
        shutil.copytree(options.folder / "input", options.keep / f"{options.seed}-{index}", dirs_exist_ok=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--index", type=int, help="Repeat this input alone.")
    parser.add_argument("--kinds", nargs="+", default=["clouds", "meshes", "recordings", "others"])
    parser.add_argument("--keep", type=Path, help="A folder for inputs that found something.")
    parser.add_argument("--folder", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.folder:
        sys.exit(work(options))
    # In a process of its own: an input may end it, or keep it from ever ending.
    with tempfile.TemporaryDirectory() as folder:
        code = subprocess.call([sys.executable, __file__, *sys.argv[1:], "--folder", folder])
        if not (Path(folder) / "done").exists():
            index = (Path(folder) / "index").read_text() if (Path(folder) / "index").exists() else "none"
            say(f"FOUND: the process ended with {code} at input {index} of seed {options.seed}\n{last(folder)}")
            options.folder = Path(folder)
            if options.keep and (Path(folder) / "input").exists():
                shutil.copytree(Path(folder) / "input", options.keep / f"{options.seed}-crash", dirs_exist_ok=True)
            code = 1
    sys.exit(code)


def say(text):
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def last(folder):
    path = Path(folder) / "stderr"
    return path.read_text(errors="replace")[:3000] if path.exists() else ""


if __name__ == "__main__":
    main()
