"""The FMUs give the reference numbers: the five-bar of Table 3.1 at 420 rpm, the slider-crank of section 3.1 at 50 rpm.

They are in `tests.published` and `tests.published_rahman`.
"""

from __future__ import annotations

from math import cos, pi, sin
from pathlib import Path
from typing import Any

import pytest

import tests.published_rahman as rahman
from tests import published
from tests.published import CM, DYN, DYN_CM

from .runner import run_in_process


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


@pytest.mark.parametrize("pattern", [[90], [7, 11, 2, 25, 45]], ids=["quarter turns", "uneven"])
def test_three_turns(five_bar: Path, tmp_path: Path, pattern: list[int]) -> None:
    seen = run_in_process(revolutions, five_bar, tmp_path, pattern, 1e-9, 3)
    assert seen["0"]["drive.applied_torque"] == pytest.approx(published.CRANK_TORQUE_AT_START_DYN_CM * DYN_CM, rel=1e-9)
    for angle, position in published.U_CM_AT_CRANK_DEG.items():
        assert seen[str(angle)]["slider.position"] == pytest.approx(position * CM, rel=1e-8)
    # printed to 1e-3 dyn
    fx, fy = (force * DYN for force in published.FORCE_AT_C_AT_360_DEG_DYN)
    assert seen["360"]["pin.C.fx"] == pytest.approx(fx, abs=1e-8)
    assert seen["360"]["pin.C.fy"] == pytest.approx(fy, abs=5e-8)


#: Lengths in inches and angles in degrees as the thesis gives them, in the FMU's units.
RAHMAN = {"guide.offset": rahman.INCH, "initial.shift_position": rahman.INCH, "guide.twist": pi / 180.0}


def mechanism(offset_in: float = 10.0, shift_in: float = 0.0, twist_deg: float = 270.0) -> dict[str, float]:
    """Values of the FMU for a case of section 3.1."""
    return {name: factor * value for (name, factor), value in zip(RAHMAN.items(), (offset_in, shift_in, twist_deg))}


def at_angles(fmu: str, folder: str, values: dict[str, float], angles: list[float], load: float) -> list[Any]:
    """Outputs at 50 rpm, 300 degrees in a second, at crank angles in degrees, each beside those under a slider load."""
    from bare_master import Fmu

    instance = Fmu(fmu, folder).instantiate().start(values)
    rows = []
    time = 0.0
    for angle in angles:
        end = angle / 300.0
        if end > time:
            assert instance.step(time, end - time) == 0
        time = end
        free = instance.outputs()
        instance.set("slider.load", load)
        rows.append([free, instance.outputs()])
        instance.set("slider.load", 0.0)
    return rows


@pytest.mark.parametrize("spot", rahman.SPOTS, ids=["offset and shift", "offset and twist"])
def test_slider_crank_at_30_degrees(slider_crank: Path, tmp_path: Path, spot: rahman.Spot) -> None:
    load = spot.slider_force_lb * rahman.POUND_FORCE
    values = mechanism(spot.offset_in, spot.shift_in, spot.twist_deg)
    free, loaded = run_in_process(at_angles, slider_crank, tmp_path, values, [7.0, 11.0, 30.0], load)[-1]
    assert free["crank.angle"] == pytest.approx(pi / 6, rel=1e-12)
    assert free["slider.position"] / rahman.INCH == pytest.approx(spot.position_in, abs=6e-7)
    assert free["slider.velocity"] / rahman.INCH == pytest.approx(spot.velocity_in_s, abs=6e-7)
    assert free["slider.acceleration"] / rahman.INCH == pytest.approx(spot.acceleration_in_s2, abs=6e-6)
    # slider load given, torque sought; and torque given, slider force sought
    assert free["drive.applied_torque"] / rahman.POUND_INCH == pytest.approx(spot.torque_lb_in, abs=6e-6)
    torque = loaded["drive.applied_torque"]
    assert torque / rahman.POUND_INCH == pytest.approx(rahman.TORQUE_LB_IN, abs=2e-5)
    # section 3.2: 2F2j = -T/a1 at constant speed, and no moments of the guide
    force = loaded["crank_pin.fy"] * cos(pi / 6) - loaded["crank_pin.fx"] * sin(pi / 6)
    assert force == pytest.approx(torque / (rahman.CRANK_IN * rahman.INCH), rel=1e-10)
    assert loaded["guide.mx"] == loaded["guide.my"] == loaded["guide.mz"] == 0.0
    for row in (free, loaded):
        assert row["closure.residual"] < 1e-15
        assert abs(row["energy.residual"]) < 1e-8
