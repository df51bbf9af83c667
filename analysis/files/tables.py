"""Tables of numbers: CSV files of results and signals, arrays for caches."""

from __future__ import annotations

import csv
import hashlib
import io
import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from linkwork.errors import InputError

from .paths import first_line, read_text, whole


def write_csv(path: str | Path, columns: Mapping[str, ArrayLike]) -> Path:
    """Write columns of equal length with a header line; numbers in full precision.

    Raises
    ------
    InputError
        If the columns differ in length.
    """
    arrays = {name: np.asarray(values, dtype=float) for name, values in columns.items()}
    lengths = {name: len(values) for name, values in arrays.items()}
    if len(set(lengths.values())) > 1:
        raise InputError(f"the columns of a CSV file differ in length: {lengths}")
    # a name with a comma in it is one column all the same
    header = ",".join(f'"{name}"' if "," in name else name for name in arrays)
    with whole(path := Path(path)) as part:
        np.savetxt(part, np.column_stack(list(arrays.values())), delimiter=",", header=header, comments="", fmt="%.17g")
    return path


def read_csv(path: str | Path) -> NDArray[np.float64]:
    """The numbers of a CSV file below its header line, shape (rows, columns).

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        rows: NDArray[np.float64] = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read as CSV: {first_line(error)}") from error
    return rows


def read_rows(path: str | Path) -> list[dict[str, str]]:
    """The rows of a CSV file, their texts by the names in its header line.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    path = Path(path)
    try:
        return list(csv.DictReader(read_text(path).splitlines()))
    except csv.Error as error:
        raise InputError(f"{path} cannot be read: {error}") from error


def save_array(path: str | Path, values: ArrayLike) -> Path:
    """Write an array to a file that is there complete or not at all, for caches; see `load_array`."""
    content = io.BytesIO()
    np.save(content, np.asarray(values, dtype=float))
    with whole(path := Path(path)) as part:
        part.write_bytes(content.getvalue() + hashlib.sha256(content.getvalue()).digest())
    return path


def load_array(path: str | Path) -> NDArray[np.float64] | None:
    """An array from a file of `save_array`; None if it is not there, or, with a warning, if it is damaged.

    The hash at its end says whether it is what was written.
    """
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
    values: NDArray[np.float64] = np.load(io.BytesIO(content))
    return values


_DIGEST = hashlib.sha256().digest_size
