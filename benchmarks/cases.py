"""Small inputs with the troubles that people report: what `pcsr` makes of each, beside what it must.

python benchmarks/cases.py FOLDER [--model midpoint] [--only NAME]

FOLDER has a README.md with a table: the first column names files beside it in backquotes, the last says what each must
give. Most files hold the cloud of xyzrgb.txt, each with another trouble. The exit code is 1 if a file is not ok.
"""

import re
import sys
import tempfile
from pathlib import Path

import click
from case_checks import CHECKS, Verdict
from case_runs import Case
from rich.console import Console
from rich.markup import escape
from rich.table import Table

FOREIGN = re.compile("traceback|usecols|pydantic|codec|validation error|numpy|laspy|could not convert", re.IGNORECASE)
"""Words of libraries and of unexpected errors."""


def checked(case: Case) -> Verdict:
    check = next((check for names, check in CHECKS.items() if case.path.name in names.split()), None)
    if check is None or not case.path.is_file():
        return False, "no check is known" if check is None else "there is no such file"
    try:
        good, what = check(case)
    except click.ClickException as error:
        return False, error.message
    except Exception as error:  # of whatever the result is like: a row, not the end
        return False, f"{type(error).__name__}: {error}"
    return good and not FOREIGN.search(what), what


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@click.option("--model", default="frames", show_default=True, help="Model of `pcsr upsample`.")
@click.option("--only", default="", help="Check only files whose names contain this.")
def main(folder: Path, model: str, only: str) -> None:
    """Print what happens to each file of a folder."""
    console = Console() if sys.stdout.isatty() else Console(width=200)
    table = Table("file", "must", "gives", "ok")
    verdicts = []
    for line in (folder / "README.md").read_text(encoding="utf-8").splitlines():
        files, must = line.strip("| ").split("|")[0], line.strip("| ").split("|")[-1].strip()
        for name in re.findall(r"`([^`]+\.\w+)`", files.split("beside")[0]) if line.startswith("|") else []:
            if only in name:
                with tempfile.TemporaryDirectory() as results:
                    good, what = checked(Case(folder / name, Path(results), model))
                    what = what.replace(f"{folder}/", "").replace(f"{results}/", "")
                table.add_row(name, escape(must), escape(what), "ok" if good else "NOT OK")
                verdicts.append(good)
    console.print(table)
    console.print(f"{sum(verdicts)} of {len(verdicts)} files are ok")
    raise SystemExit(not all(verdicts))


if __name__ == "__main__":
    main()
