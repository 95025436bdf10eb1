"""Measured tables: printed, and as files in docs/numbers, which pages include (`make pages`)."""

import json
import os
import platform
from collections.abc import Sequence
from pathlib import Path

import torch
from rich import box
from rich.console import Console
from rich.table import Table

from pcsr.files import write_text

NUMBERS = Path(__file__).parents[1] / "docs" / "numbers"


def show(columns: Sequence[str], rows: Sequence[Sequence[str]], title: str | None = None) -> None:
    """Print a table in Markdown, as wide as it need be."""
    table = Table(*columns, title=title, box=box.MARKDOWN)
    for row in rows:
        table.add_row(*row)
    Console(width=1000).print(table)


def save(name: str, command: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Write a table, with the command that made it and the machine it was made on."""
    where = f"{os.cpu_count()} cores, {platform.machine()}, torch {torch.__version__}"
    head = {"command": command, "where": where, "columns": list(columns)}
    lines = [f"  {json.dumps(key)}: {json.dumps(value, ensure_ascii=False)},\n" for key, value in head.items()]
    cells = ",\n".join(f"    {json.dumps(list(row), ensure_ascii=False)}" for row in rows)
    write_text(NUMBERS / f"{name}.json", "{\n" + "".join(lines) + f'  "rows": [\n{cells}\n  ]\n}}\n')
