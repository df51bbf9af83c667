"""The FMU with its defaults gives the reference numbers of Table 3.1 at 420 rpm.

The numbers were derived independently of this project and cross-checked against two multibody engines; cgs as noted,
SI here.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from .runner import run_in_process

POSITION_CM = {90: 0.5091697521, 360: -1.0018190123, 720: -0.8902721383, 1080: -0.8955749071}
TORQUE_AT_REST_DYN_CM = -1.129656931e7
FORCE_AT_C_DYN = (79534.254, 537313.426)
STEADY_POSITION_CM = -0.89553115
STEADY_VELOCITY_CM_S = -21.92156554


def revolutions(fmu: str, folder: str, pattern: list[int], tolerance: float, turns: int) -> dict[str, Any]:
    """Outputs at every quarter turn; the steps are the degrees of ``pattern``, over and over."""
    from bare_master import Fmu

    degree = 1.0 / 7.0 / 360.0
    instance = Fmu(fmu, folder).instantiate().start({"solver.tolerance": tolerance})
    seen = {0: instance.outputs()}
    angle = 0
    while angle < 360 * turns:
        for size in pattern:
            assert instance.step(angle * degree, size * degree) == 0
            angle += size
            if angle % 90 == 0:
                seen[angle] = instance.outputs()
    instance.free()
    return seen


@pytest.mark.parametrize(
    "pattern", [[90], [1], [30], [7, 11, 2, 25, 45]], ids=["quarter turns", "degrees", "30 degrees", "uneven"]
)
def test_three_turns(fmu: Path, tmp_path: Path, pattern: list[int]) -> None:
    seen = run_in_process(revolutions, fmu, tmp_path, pattern, 1e-9, 3)
    assert seen["0"]["drive.applied_torque"] == pytest.approx(TORQUE_AT_REST_DYN_CM * 1e-7, rel=1e-9)
    for angle, position in POSITION_CM.items():
        assert seen[str(angle)]["slider.position"] == pytest.approx(position * 1e-2, rel=1e-8)
    # printed to 1e-3 dyn
    fx, fy = (force * 1e-5 for force in FORCE_AT_C_DYN)
    assert seen["360"]["pin.C.fx"] == pytest.approx(fx, abs=1e-8)
    assert seen["360"]["pin.C.fy"] == pytest.approx(fy, abs=5e-8)


def test_three_turns_at_a_tighter_tolerance(fmu: Path, tmp_path: Path) -> None:
    seen = run_in_process(revolutions, fmu, tmp_path, [90], 1e-13, 3)
    for angle, position in POSITION_CM.items():
        assert seen[str(angle)]["slider.position"] == pytest.approx(position * 1e-2, abs=0.6e-12)
    assert seen["360"]["pin.C.fx"] == pytest.approx(FORCE_AT_C_DYN[0] * 1e-5, abs=0.6e-8)
    assert seen["360"]["pin.C.fy"] == pytest.approx(FORCE_AT_C_DYN[1] * 1e-5, abs=0.6e-8)
    for quantity in seen.values():
        assert quantity["closure.residual"] < 1e-15


def test_steady_state(fmu: Path, tmp_path: Path) -> None:
    last = run_in_process(revolutions, fmu, tmp_path, [90], 1e-9, 40)["14400"]
    assert last["slider.position"] == pytest.approx(STEADY_POSITION_CM * 1e-2, rel=1e-8)
    assert last["slider.velocity"] == pytest.approx(STEADY_VELOCITY_CM_S * 1e-2, rel=1e-8)
