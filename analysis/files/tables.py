"""Read and write tables of numbers: CSV files of results and signals, and arrays for caches."""

from __future__ import annotations

import csv
import hashlib
import io
import re
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from itertools import zip_longest
from math import isfinite, nan
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError, Interrupted

from .outputs import output
from .paths import is_number, read_text, write_completely
from .reader import unknown_name

#: Count of numbers that are written in one block; Ctrl-C takes effect between blocks.
_BLOCK = 50_000
#: Least size (bytes) of a file that is announced, with its progress shown on a terminal.
LARGE = 20_000_000


def write_csv(path: str | Path, columns: Mapping[str, ArrayLike]) -> Path:
    """Write columns of equal length, by name, to a CSV file in full precision, and return its path.

    Raises
    ------
    InputError
        If the columns differ in length, or the folder does not exist.
    Interrupted
        If Ctrl-C was pressed; no file is left then.
    """
    arrays = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
    lengths = {name: len(values) for name, values in arrays.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(f"the columns of a CSV file differ in length: {lengths}")
    path = Path(path)
    if not path.parent.is_dir():
        raise InputError(f"there is no folder {path.parent} for {path.name}: make it first")
    header = ",".join(map(cell, arrays))
    try:
        with output(path) as (part, path), part.open("w", encoding="utf-8", newline="\n") as file:
            file.write(header + "\n")
            _write_rows(file, path, list(arrays.values()))
    except KeyboardInterrupt:
        raise Interrupted(f"interrupted: {path} was not written") from None
    return path


def _write_rows(file: TextIO, path: Path, columns: Sequence[NDArray[np.float64]]) -> None:
    """Write the rows of a CSV table to a file in blocks; announce a large file and show the progress."""
    count, block = len(columns[0]), max(1, _BLOCK // len(columns))
    row = ",".join(["%.17g"] * len(columns)) + "\n"
    done: Callable[[int], None] | None = None
    with ExitStack() as stack:
        for first in range(0, count, block):
            values = np.column_stack([column[first : first + block] for column in columns])
            text = row * len(values) % tuple(values.ravel().tolist())
            size = len(text) / len(values) * count
            if first == 0 and size >= LARGE:
                sys.stderr.write(f"linkwork: writing {path}, about {size / 1e6:.0f} MB; Ctrl-C stops it ...\n")
                done = stack.enter_context(_progress_bar(path.name, count))
            file.write(text)
            if done is not None:
                done(first + len(values))


@contextmanager
def _progress_bar(what: str, count: int) -> Iterator[Callable[[int], None]]:
    """Show a progress bar if standard error is a terminal; yield a function to be called with the number of rows done."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=count)
        yield lambda rows: bar.update(task, completed=rows)


def cell(text: str) -> str:
    """Return a text as a cell of a CSV file: in one line, quoted if necessary, and never executed as a formula.

    A text that begins like a formula, perhaps after blanks, gets an apostrophe in front; to a spreadsheet it is then a text.
    """
    text = " ".join(text.splitlines())
    if text.lstrip().startswith(_FORMULA) and not is_number(text):
        text = f"'{text}"
    return '"{}"'.format(text.replace('"', '""')) if any(mark in text for mark in _SPLITTING) else text


#: First characters of a cell that a spreadsheet executes.
_FORMULA = tuple("=+-@")
#: Characters that end a cell, here or in a spreadsheet of another country.
_SPLITTING = ',;\t"'


def is_meant_as_number(cell: str) -> bool:
    """Return whether a cell is meant as a number, and not as a heading, even if Python cannot read the number."""
    return is_number(cell) or _BROKEN_NUMBER.fullmatch(cell) is not None


def read_record(
    path: str | Path, names: Sequence[str | None] | None = None
) -> tuple[list[str], list[NDArray[np.float64]]]:
    """Read columns of numbers, and the units in their headings, from a CSV file with commas, semicolons or tabs between cells.

    Where semicolons or tabs are between the cells, numbers may have a decimal comma. Headings are those of a header line, or
    of a comment, ``# t [ms],x [mm]``, directly above the numbers. A line of units, ``ms,mm``, may follow the header line.

    Parameters
    ----------
    path : str or Path
    names : sequence of str or None, optional
        Name of each wanted column in the header line, with or without its unit in brackets; by default all columns. None stands
        for the column of the file at the same position. A file without headings has no names.

    Returns
    -------
    units : list of str
        `heading_unit` of each column, or the unit below its heading.
    columns : list of ndarray
        Numbers as they are in the file.

    Raises
    ------
    InputError
        If the file cannot be read, has no headings where a name is given, has a cell that is not a finite number, has a number
        beyond the last column, or has two units for a column; the message gives the line.
    UnknownNameError
        If the file has no column of a given name.
    """
    path = Path(path)
    text = read_text(path).splitlines()
    lines = [(i, line) for i, line in enumerate(text, 1) if line.partition("#")[0].strip()]
    if lines and SEPARATOR_LINE.match(lines[0][1]):
        del lines[0]
    # a comment above the numbers, as NumPy writes headings
    comment = text[lines[0][0] - 2].lstrip("# ") if lines and lines[0][0] > 1 else ""
    separator = _find_separator(lines[0][1]) if lines else ","
    try:
        rows = [(number, cells) for number, line in lines if (cells := _split_cells(line, separator))]
        above = _split_cells(comment, _find_separator(comment))
    except csv.Error as error:
        raise InputError(f"{path} cannot be read: {error}") from error

    def as_number(cell: str) -> str:
        return cell.strip() if separator == "," else cell.strip().replace(",", ".")

    first = as_number(rows[0][1][0]) if rows else "0"
    header = [] if is_meant_as_number(first) else rows.pop(0)[1]
    units = [heading_unit(name) for name in header]
    if header and rows and not any(map(NO_UNIT.match, rows[0][1])):
        units = units_below(units, *rows.pop(0)[::-1], path)
    if not rows:
        raise InputError(f"{path} has no numbers: it must have rows of numbers, and may have a header line above them")
    if not header and len(above) == len(rows[0][1]):
        header = above
        units = [heading_unit(name) for name in header]
    header = [name.strip() for name in header]
    short = [_UNIT.sub("", known).strip() for known in header]
    width = len(header or rows[0][1])
    places = []
    for place, given in enumerate([None] * width if names is None else names):
        name = given and given.strip()
        if name is not None and not header:
            raise InputError(
                f"{path} has no headings, and so no column {name!r}: its columns are taken by their position"
            )
        if name is not None and name not in header and short.count(name) != 1:
            raise unknown_name(name, header, f"column {name!r} in {path.name}")
        places.append(place if name is None else header.index(name) if name in header else short.index(name))
    for number, cells in rows:
        if any(is_number(as_number(cell)) for cell in cells[width:]):
            raise InputError(
                f"{path}, line {number}: {len(cells)} cells in a table of {width} columns; numbers with a decimal comma need "
                "semicolons or tabs between them, and what is above the headings a # at its beginning"
            )
    columns = np.empty((len(places), len(rows)))
    for column, place in zip(columns, places):
        for i, (number, cells) in enumerate(rows):
            own = as_number(cells[place]) if place < len(cells) else ""
            column[i] = float(own) if is_number(own) else nan
            if not isfinite(column[i]):
                hint = ""
                if len(own.split()) > 1 and all(map(is_number, own.split())):
                    hint = "; between the cells there must be commas, semicolons or tabs"
                raise InputError(
                    f"{path}, line {number}, column {place + 1}: {own[:40]!r} is not a finite number{hint}"
                )
    return [units[place] if place < len(units) else "" for place in places], list(columns)


#: Line that tells Excel which mark is between the cells.
SEPARATOR_LINE = re.compile(r"\"?sep=", re.IGNORECASE)
#: A number that Python does not read, such as "1 234", "1,234.5", or one with a minus sign of typography: no heading.
_BROKEN_NUMBER = re.compile(r"[-+\u2212\d.,'\s]*\d[-+\u2212\d.,'\sEeDd]*")
#: A cell that cannot be a unit below a heading.
NO_UNIT = re.compile(r"[\s\[(]*[-+.,]*(?:\d|(?:nan|inf|infinity)\s*$)", re.IGNORECASE)


def units_below(units: Sequence[str], cells: Sequence[str], line: int, path: Path) -> list[str]:
    """Return the units of columns from their headings, completed by the cells of the line below, such as ``ms`` or ``[mm]``.

    Raises InputError if the two differ.
    """
    below = [cell.strip().strip('"[]()- ') for cell in cells]
    for one, other in zip(units, below):
        if one and other and one != other:
            raise InputError(f"{path}, line {line}: the unit {other!r} is below a heading with the unit {one!r}")
    return [one or other for one, other in zip_longest(units, below, fillvalue="")]


def _find_separator(line: str) -> str:
    """Return what separates the cells of a CSV file with this first line: a semicolon, a tab or a comma."""
    plain = re.sub('"[^"]*"', "", line)
    # look into a comment only if there is no separator before it, as in "drive #1;torque"
    for part in (plain.partition("#")[0], plain):
        for mark in ";\t,":
            if mark in part:
                return mark
    return ","


def _split_cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line of a CSV file, without a comment after a number, and without blank cells at the end."""
    cells = next(csv.reader([line], delimiter=separator), []) if '"' in line else line.split(separator)
    for place, cell in enumerate(cells if "#" in line else ()):
        own, mark, _ = cell.partition("#")
        if mark and is_number(own.replace(",", ".")):
            cells = [*cells[:place], own]
            break
    while cells and not cells[-1].strip():
        cells.pop()
    return cells


#: A unit in brackets at the end of a heading, or before a comment.
_UNIT = re.compile(r"[\[(]([^\[\]()]*)[\])]\s*(?:#.*)?$")


def heading_unit(heading: str) -> str:
    """Return the unit in brackets at the end of a heading, as of ``time [ms]`` or ``x (mm)``; empty if there is none.

    A number in brackets, as of ``x[0]``, is an index.
    """
    found = _UNIT.search(heading)
    return found[1].strip() if found and not found[1].strip().isdigit() else ""


def read_rows(path: str | Path) -> list[dict[str, str]]:
    """Read the rows of a CSV file; each row is a dictionary of texts by the names in the header line.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    path = Path(path)
    try:
        return [
            # ignore cells beyond the header line, and names without a cell
            {name: text for name, text in row.items() if isinstance(name, str) and isinstance(text, str)}
            for row in csv.DictReader(read_text(path).splitlines())
        ]
    except csv.Error as error:
        raise InputError(f"{path} cannot be read: {error}") from error


def save_array(path: str | Path, values: ArrayLike) -> Path:
    """Write an array and its hash to a file of a cache, for `load_array`, and return the path."""
    content = io.BytesIO()
    np.save(content, np.asarray(values, dtype=float))
    with write_completely(path := Path(path)) as part:
        part.write_bytes(content.getvalue() + hashlib.sha256(content.getvalue()).digest())
    return path


def load_array(path: str | Path) -> NDArray[np.float64] | None:
    """Read an array that `save_array` wrote; None if there is no file, or, with a warning, if the hash does not match."""
    path = Path(path)
    try:
        if not path.is_file():
            return None
        content = path.read_bytes()
    except OSError:
        return None
    content, digest = content[:-_DIGEST], content[-_DIGEST:]
    if hashlib.sha256(content).digest() != digest:
        warnings.warn(f"{path} is damaged: what was in it is computed again", RuntimeWarning, stacklevel=2)
        return None
    return np.load(io.BytesIO(content))


_DIGEST = hashlib.sha256().digest_size
