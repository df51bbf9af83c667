"""The standard cases on which the FMU is held against the in-process solver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import pi
from pathlib import Path
from types import MappingProxyType
from typing import Any

from linkwork.errors import InputError
from linkwork.five_bar.published import TABLE_3_1
from linkwork.slider_crank.published import OFFSET_CASE

from ..units import RAD_S_PER_RPM
from .case import Case, published_case
from .cosimulation import Comparison, compare, cosimulate
from .inputs import Inputs
from .signals import Harmonics, InductionMotor, TorsionBar, ramp, steps, table
from .simulation import simulate
from .trajectory import Trajectory

_SPEED = 14.0 * pi  # 420 rpm

#: The interfaces that a run in process can be held against.
CHECKED = ("co-simulation", "model-exchange")


def _case(title: str, inputs: Inputs, **changes: Any) -> Case:
    return Case(
        title=title, parameters=replace(TABLE_3_1, **changes), inputs=inputs, stop_time=0.4, step=1e-3, tolerance=1e-9
    )


def _slider_crank(title: str, inputs: Inputs, **changes: Any) -> Case:
    parameters, initial = OFFSET_CASE
    return Case(
        title=f"slider-crank: {title}",
        parameters=replace(parameters, **changes),
        initial=initial,
        inputs=inputs,
        stop_time=1.2,
        step=4e-3,
        tolerance=1e-9,
    )


_RPM_50 = 50.0 * RAD_S_PER_RPM
_GENERAL = {
    "guide_twist": 4.0,
    "crank_cog_y": 0.02,
    "crank_cog_z": -0.05,
    "crank_product_xz": 0.02,
    "crank_product_yz": -0.01,
    "slider_cog_x": 0.02,
    "slider_cog_z": 0.03,
    "gravity_y": -9.81,
    "gravity_z": 1.0,
}

#: By name: every way of driving and loading a mechanism, the five-bar's on Table 3.1, the slider-crank's on Rahman's case
#: a4 = 10 in, S1 = 3.5 in.
CASES: Mapping[str, Case] = MappingProxyType(
    {
        "table-3.1": published_case("table-3.1"),
        "constant-speed": _case("constant speed of 300 rpm", Inputs(speed=10.0 * pi)),
        "speed-ramp": _case("ramp of the speed from 100 to 420 rpm", Inputs(speed=ramp(10.0, _SPEED, 0.05, 0.3))),
        "speed-jump": _case("jumps of the speed", Inputs(speed=steps([0.0, 0.1, 0.25], [20.0, 40.0, 30.0]))),
        "torque-switched-off": _case(
            "torsion bar of 1e8 dyn.cm, released at 1 rad", Inputs(torque=TorsionBar(torque=10.0))
        ),
        "induction-motor": _case(
            "run-up by an induction motor",
            Inputs(torque=InductionMotor(breakdown_torque=5.0, breakdown_slip=0.2, synchronous_speed=50.0)),
        ),
        "control-force": _case(
            "harmonic control force on the slider", Inputs(speed=_SPEED, force=Harmonics(1.0, [5.0], [30.0], [0.3]))
        ),
        "load": _case(
            "load at the coupler point",
            Inputs(speed=_SPEED, load_x=3.0, load_y=table([0.0, 0.2, 0.4], [0.0, 5.0, -2.0], "cubic")),
            coupler_point_distance=0.1,
            coupler_point_angle=0.4,
        ),
        "inclined-guide": _case(
            "guide and ground inclined", Inputs(speed=_SPEED), slider_guide_angle=0.4, ground_inclination=0.3
        ),
        "other-assembly": _case("the other assembly", Inputs(speed=_SPEED), assembly_branch=-1),
        "coulomb-friction": _case(
            "Coulomb friction of 5 N in the guide", Inputs(speed=_SPEED), slider_coulomb_friction=5.0
        ),
        "contact-friction": _case(
            "friction in guide and pins by their forces",
            Inputs(speed=_SPEED),
            slider_friction_coefficient=0.2,
            pin_A_friction_radius=1e-3,
            pin_B_friction_radius=1e-3,
            pin_C_friction_radius=1e-3,
            pin_D_friction_radius=1e-3,
        ),
        "slider-crank-constant-speed": _slider_crank("50 rpm, the shift held", Inputs(speed=_RPM_50)),
        "slider-crank-torque": _slider_crank(
            "a torque of 10 N.m against a load", Inputs(torque=10.0, load=table([0.0, 1.2], [0.0, -20.0]))
        ),
        "slider-crank-shifted": _slider_crank(
            "ramp of the speed, the shift to and fro",
            Inputs(speed=ramp(2.0, 6.0, 0.2, 0.8), shift_speed=Harmonics(0.0, [0.2], [8.0], [0.0])),
        ),
        "slider-crank-jumps": _slider_crank(
            "jumps of both speeds",
            Inputs(speed=steps([0.0, 0.4], [5.0, 3.0]), shift_speed=steps([0.0, 0.6], [0.1, -0.1])),
        ),
        "slider-crank-free-shift": _slider_crank(
            "both freedoms free, spring and damper on the shift",
            Inputs(torque=5.0, axial_force=Harmonics(0.0, [20.0], [6.0], [0.0])),
            shift_stiffness=500.0,
            shift_damping=20.0,
        ),
        "slider-crank-groove": _slider_crank(
            "a groove makes the shift",
            Inputs(torque=5.0, groove=True),
            groove_amplitude=0.1,
            groove_ratio=2.0,
        ),
        "slider-crank-general": _slider_crank(
            "general twist and masses, springs, dampers, friction, gravity, the other assembly",
            Inputs(speed=_RPM_50, axial_force=3.0),
            **_GENERAL,
            shift_stiffness=800.0,
            slider_stiffness=200.0,
            slider_spring_free_position=-1.0,
            slider_damping=15.0,
            slider_coulomb_friction=2.0,
            assembly_branch=-1,
        ),
    }
)


def check(
    fmu: str | Path,
    case: Case,
    *,
    interface: str = "co-simulation",
    method: str = "compiled",
    tolerance: float = 1e-6,
    progress: bool = False,
) -> tuple[Trajectory, Trajectory, Comparison]:
    """Run a case in process and through an FMU, with the same inputs, and compare every output.

    In co-simulation the inputs are held on both sides, and the compiled solver takes the same steps as the FMU's: it may agree
    with it to the last bit, which tests the packaging and every path between. With one of SciPy's methods or Hamming's the
    integration is an independent one too. In model exchange it is CVode's: both integrate to a hundredth of the case's
    tolerance, so that what is left is not their error.

    Returns
    -------
    in_process, through_fmu : Trajectory
    comparison : Comparison

    Raises
    ------
    InputError
        If ``interface`` is none that holds the inputs or lets them act continuously on both sides.
    LinkworkError
        As `simulate` and `cosimulate`.
    """
    if interface not in CHECKED:
        raise InputError(f"interface is {interface!r}: a check is of {' or '.join(CHECKED)}")
    held = interface == "co-simulation"
    common: dict[str, Any] = {
        "initial": case.initial,
        "stop_time": case.stop_time,
        "step": case.step,
        "tolerance": case.tolerance if held else max(0.01 * case.tolerance, 1e-13),
        "progress": progress,
    }
    in_process = simulate(case.parameters, case.inputs, hold=case.step if held else None, method=method, **common)
    through_fmu = cosimulate(fmu, case.parameters, case.inputs, interface=interface, **common)
    return in_process, through_fmu, compare(in_process, through_fmu, tolerance=tolerance)
