"""What can be said of an FMU without running it: FMPy's validation of the archive and of the model description."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .findings import WRONG, Finding


def check_statically(fmu: Path, description: Any) -> list[Finding]:
    """Note a finding for each problem that FMPy sees: schema, variables, structure, archive."""
    from fmpy.validation import validate_fmu

    return [
        Finding(severity=WRONG, key=f"static: {problem}", text=f"model description: {problem}", calls=[], replay="")
        for problem in validate_fmu(str(fmu))
    ]
