"""Make the parts of a job's answer to the page: charts, and files for the browser to save."""

from __future__ import annotations

import base64
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Answer = dict[str, Any]
FloatArray = NDArray[np.float64]


def chart(title: str, unit: str, angle: FloatArray, values: FloatArray) -> Answer:
    """Return a chart of values over the crank angle (rad), both of shape (n,); ``unit`` is the unit of the values."""
    return {
        "title": title,
        "unit": unit,
        "axis": "crank angle [deg]",
        "x": np.degrees(angle).tolist(),
        "y": values.tolist(),
    }


def folder() -> tempfile.TemporaryDirectory[str]:
    """Return a temporary folder, which is deleted at the end of its context."""
    return tempfile.TemporaryDirectory(prefix="linkwork-", ignore_cleanup_errors=True)


def file(path: Path) -> Answer:
    """Return the content of a file, with its name, for the browser to save."""
    return {"name": path.name, "base64": base64.b64encode(path.read_bytes()).decode()}
