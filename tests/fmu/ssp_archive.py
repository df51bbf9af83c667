"""Read an archive of SSP for masters that cannot; functions in `runner.run_in_process` can import it, like `bare_master`."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any, NamedTuple


class Archive(NamedTuple):
    """For each part: path of its FMU, start values, value references by name; and the connected output of each input."""

    fmus: dict[str, str]
    starts: dict[str, dict[str, float]]
    references: dict[str, dict[str, int]]
    wires: dict[tuple[str, str], tuple[str, str]]


def unpack(archive: str) -> Archive:
    """Unpack an archive of SSP into the folder "unpacked", and read it by FMPy."""
    from fmpy import read_model_description
    from fmpy.ssp.ssd import read_ssd, read_ssv

    with zipfile.ZipFile(archive) as content:
        content.extractall("unpacked")
    system = read_ssd(archive).system
    ends = {(w.endElement, w.endConnector): (w.startElement, w.startConnector) for w in system.connections}
    found = Archive({}, {}, {}, ends)
    for part in system.elements:
        found.fmus[part.name] = fmu = str(Path("unpacked", part.source).absolute())
        parameters = read_ssv(f"unpacked/resources/{part.name}.ssv").parameters
        kinds: dict[str, Any] = {"Real": float, "Integer": int}
        found.starts[part.name] = {p.name: kinds[p.type](p.value) for p in parameters}
        found.references[part.name] = {v.name: v.valueReference for v in read_model_description(fmu).modelVariables}
    return found
