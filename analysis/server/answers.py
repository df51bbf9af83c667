"""What an answer is made of: charts, and files for the browser to save."""

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
    """A curve over the crank angle (rad)."""
    return {
        "title": title,
        "unit": unit,
        "axis": "crank angle [deg]",
        "x": np.degrees(angle).tolist(),
        "y": values.tolist(),
    }


def folder() -> tempfile.TemporaryDirectory[str]:
    """A folder for the time of a job."""
    return tempfile.TemporaryDirectory(prefix="linkwork-", ignore_cleanup_errors=True)


def file(path: Path) -> Answer:
    """A file that was written, for the browser to save."""
    return {"name": path.name, "base64": base64.b64encode(path.read_bytes()).decode()}
