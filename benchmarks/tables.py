"""Read and write the tables of results, and format them for the pages and for the terminal."""

import csv
import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from rich.table import Table


def read(path: Path) -> list[dict[str, str]]:
    """Read the rows of a CSV file, by heading."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def write(path: Path, headings: Sequence[str], rows: Iterable[Iterable[str]]) -> None:
    """Write a CSV file; the old file is replaced in one operation."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f"{path.name}.new")
    with beside.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows([headings, *rows])
    os.replace(beside, path)


def markdown(headings: Sequence[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table in Markdown."""
    return "\n".join(f"| {' | '.join(row)} |" for row in (headings, ["---"] * len(headings), *rows))


def numbers(title: str, headings: Iterable[str], texts: Sequence[str] = ("",)) -> Table:
    """Return a table of numbers for the terminal, still without rows; the columns ``texts`` are aligned at the left."""
    table = Table(title=title)
    for heading in headings:
        table.add_column(heading, justify="left" if heading in texts else "right")
    return table
