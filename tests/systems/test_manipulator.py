"""A published benchmark of co-simulation: a planar arm that a hydraulic cylinder moves, against its published motion."""

from math import sqrt
from pathlib import Path

import numpy as np
import pytest

from analysis.linkages import linkage
from analysis.systems import End, System, run_system
from analysis.systems.description import PartTable, RunTable

from ..fmu.runner import run_in_process

#: Length of the actuator (m) over time (s) in manoeuvre M1: F. Gonzalez, cosim-benchmarks,
#: doc/data/hydraulicManipulator_ref.csv, one model in Cartesian coordinates at steps of 5e-5 s.
LENGTHS = (0.5, 0.51736094, 0.53918989, 0.56539686, 0.59603536, 0.5809673, 0.56266526, 0.54106009, 0.51536899)
PUBLISHED = dict(zip(range(2, 11), LENGTHS))


def make(folder: str, here: str) -> str:
    """Make the FMU of the hydraulics."""
    import sys
    from pathlib import Path

    from pythonfmu.builder import FmuBuilder

    sys.path.insert(0, here)
    script = Path(folder, "hydraulics_fmu.py")
    lines = (
        f"import sys; sys.path.insert(0, {here!r})",
        "from tests.systems.hydraulics import Hydraulics",
        "class Cylinder(Hydraulics): pass",
    )
    text = "\n".join(lines)
    script.write_text(text, encoding="utf-8")
    return str(FmuBuilder.build_FMU(script, dest=folder))


def manipulator(tmp_path: Path) -> System:
    """A boom of 200 kg with 250 kg at its end, a jib without mass with 100 kg at its end; the cylinder at the boom's middle."""
    # the boom and the mass at its end are one body
    mass, centre = 450.0, (200.0 * 0.5 + 250.0) / 450.0
    inertia = 200.0 / 12.0 + 200.0 * (centre - 0.5) ** 2 + 250.0 * (1.0 - centre) ** 2
    arm = linkage("manipulator", ground={"A": (0, 0), "B": (0.5 * sqrt(3.0), 0)}, gravity="9.81 m/s^2")
    arm.body("boom", points={"A": (0, 0), "P": (0.5, 0), "Q": (1, 0)}, mass=mass, cog=(centre, 0), inertia=inertia)
    arm.body("jib", points={"Q": (0, 0), "R": (0.5, 0)}, mass=100.0, cog=(0.5, 0), inertia=1e-9)
    arm.spring("cylinder", between=("B", "P"), driven=True)
    arm.freedom("boom", "A", driven=False, start="30 deg").freedom(
        "jib", "Q", driven=False, start="-120 deg"
    ).mechanism()
    fmu = run_in_process(make, str(tmp_path), str(Path(__file__).parents[2]), options=())
    return System(
        title="hydraulic manipulator",
        parts={"arm": PartTable(case="manipulator"), "cylinder": PartTable(fmu=str(fmu), values={"sample_time": 1e-3})},
        connections={
            End("cylinder", "angle"): End("arm", "boom.angle"),
            End("cylinder", "speed"): End("arm", "boom.speed"),
            End("arm", "cylinder.force"): End("cylinder", "force"),
        },
        run=RunTable(stop_time=10.0, step=1e-3),
        folder=tmp_path,
    )


@pytest.mark.slow
@pytest.mark.fmu
def test_the_hydraulic_manipulator_moves_as_published(tmp_path: Path) -> None:
    run = run_system(manipulator(tmp_path).wiring())
    assert run.status == 0, run.message
    found = np.interp(list(PUBLISHED), run.time, run["arm.cylinder.length"])
    np.testing.assert_allclose(found, list(PUBLISHED.values()), atol=3e-4)
