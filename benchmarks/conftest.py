"""One table at the end of `make bench`: what is measured, ours, the usual way, and the limit.

A line of the table is a group of benchmarks. Each says its role:

    ours    what pcsr does
    usual   what one would write without it
    limit   the work that cannot be saved

Times are the least of the rounds: what else the machine does makes a round longer, never shorter. A benchmark of what
else a machine does measures itself, and puts the median into `extra_info["seconds"]`.
"""

import pytest
from rich.console import Console
from rich.table import Table
from saved import save

ROLES = ("ours", "usual", "limit")
COLUMNS = ("what", "ours", "usual", "usual ÷ ours", "limit", "ours ÷ limit")


def pytest_addoption(parser):
    parser.addoption("--save", metavar="NAME", help="write docs/numbers/NAME.json, such as bench")


@pytest.fixture
def line(benchmark):
    """Put a benchmark into a line of the table: `line(what, role, asked=…, says=…)`."""

    def put(what, role="ours", asked="", says=""):
        assert role in ROLES
        benchmark.group = what
        benchmark.extra_info |= {"role": role, "asked": asked, "says": says}

    return put


def pytest_terminal_summary(config):
    session = getattr(config, "_benchmarksession", None)
    lines: dict[str, dict] = {}
    for made in session.benchmarks if session else ():
        if made.has_error or "role" not in made.extra_info:
            continue
        line = lines.setdefault(made.group, {"asked": "", "says": []})
        line[made.extra_info["role"]] = made.extra_info.get("seconds", made.stats.min)
        line["asked"] = made.extra_info["asked"] or line["asked"]
        line["says"] += [made.extra_info["says"]] if made.extra_info["says"] else []
    if lines:
        rows = [_row(what, line) for what, line in lines.items()]
        Console(width=160).print(_table(rows))
        if name := config.getoption("--save"):
            files = " ".join(config.invocation_params.args[:1])
            save(name, f'make bench ARGS="{files} --save={name}"', COLUMNS, [row[: len(COLUMNS)] for row in rows])


def _table(rows):
    table = Table(title="ours, the usual way and the limit: seconds, least of the rounds", show_lines=True)
    for column in (*COLUMNS, "asked", "also"):
        table.add_column(column, justify="left" if column in ("what", "asked", "also") else "right")
    for row in rows:
        table.add_row(*row)
    return table


def _row(what, line):
    ours, usual, limit = (line.get(role) for role in ROLES)
    past = f"{usual / ours:.1f}" if ours and usual else ""
    off = f"{ours / limit:.2f}" if ours and limit else ""
    measured = (_seconds(ours), _seconds(usual), past, _seconds(limit), off)
    return [what, *measured, line["asked"], "\n".join(line["says"])]


def _seconds(value):
    return "" if value is None else f"{value:.3g}"
