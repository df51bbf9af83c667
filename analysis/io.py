"""Reading and writing files: CSV results, and parameters and cases in TOML or JSON with units."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from linkwork.errors import InputError


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
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    header = ",".join(arrays)
    np.savetxt(part, np.column_stack(list(arrays.values())), delimiter=",", header=header, comments="", fmt="%.17g")
    os.replace(part, path)
    return path
