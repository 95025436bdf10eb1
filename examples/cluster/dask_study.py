"""Run a study on the workers of a Dask cluster, a row on each, and print its table.

Recipe, runs and plugins must have the same paths on all machines.

    python dask_study.py tcp://10.0.0.1:8786 study.yaml --runs /shared/runs
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from distributed import Client, as_completed

from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load


def run(*words: str) -> None:
    """Run `pcsr run` in this process. So it ends with a worker that is killed."""
    from pcsr.cli import pcsr

    code = pcsr.main(["run", *words], standalone_mode=False)
    if code:
        raise RuntimeError(f"pcsr run {' '.join(words)} ended with code {code}: its message is in the worker's log")


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scheduler", help="address of the scheduler")
    parser.add_argument("study", help="a recipe with a matrix, or one that names others")
    parser.add_argument("--runs", default="runs", help="a folder that all workers see")
    parser.add_argument("--set", action="append", default=[], help="a setting of all rows, such as train.epochs=5")
    parser.add_argument("--plugin", action="append", default=[], type=Path, help="a file of parts")
    given = parser.parse_args(arguments)
    options = ["--runs", given.runs, *(word for one in given.set for word in ("--set", one))]
    options += [word for file in given.plugin for word in ("--plugin", str(file))]
    rows = len(load(Path(given.study), load_plugins(given.plugin), given.set))
    with Client(given.scheduler) as client:
        one_process = ("--jobs", "1")  # a worker may not start others
        jobs = {
            client.submit(run, given.study, "--row", str(row), *one_process, *options, pure=False): row
            for row in range(1, rows + 1)
        }
        for job in as_completed(jobs):
            job.result()
            print(f"row {jobs[job]} of {rows} is finished")  # noqa: T201
    # All weights are there. They are evaluated once more, on one machine, for one table.
    run(given.study, *options)


if __name__ == "__main__":
    main()
