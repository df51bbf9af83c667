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
    """Return a curve over the crank angle (rad)."""
    return {
        "title": title,
        "unit": unit,
        "axis": "crank angle [deg]",
        "x": np.degrees(angle).tolist(),
        "y": values.tolist(),
    }


def folder() -> tempfile.TemporaryDirectory[str]:
    """Return a folder that exists while the job runs."""
    return tempfile.TemporaryDirectory(prefix="linkwork-", ignore_cleanup_errors=True)


def file(path: Path) -> Answer:
    """Return a written file for the browser to save."""
    return {"name": path.name, "base64": base64.b64encode(path.read_bytes()).decode()}
