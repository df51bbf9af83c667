"""Standard cases of the slider-crank as tables of case files: every drive and load, for a4 = 10 in and S1 = 3.5 in."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any, Mapping

_RPM_50 = {"speed": "50 rpm"}


def _case(title: str, **tables: Any) -> dict[str, Any]:
    run = {"stop_time": 1.2, "step": 4e-3}
    return {"title": f"slider-crank: {title}", "published": "rahman-a4-10-s1-3.5", "run": run, **tables}


CASES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "slider-crank-constant-speed": _case("50 rpm, the shift held", drive=_RPM_50),
        "slider-crank-torque": _case(
            "a torque of 10 N.m against a load",
            drive={"torque": 10.0},
            load={"kind": "table", "times": [0.0, 1.2], "values": [0.0, -20.0]},
        ),
        "slider-crank-shifted": _case(
            "ramp of the speed, the shift to and fro",
            drive={"speed": {"kind": "ramp", "start": 2.0, "end": 6.0, "from_time": 0.2, "to_time": 0.8}},
            axial={"speed": {"kind": "harmonics", "amplitudes": [0.2], "frequencies": [8.0]}},
        ),
        "slider-crank-jumps": _case(
            "jumps of both speeds",
            drive={"speed": {"kind": "table", "times": [0.0, 0.4], "values": [5.0, 3.0], "interpolation": "hold"}},
            axial={"speed": {"kind": "table", "times": [0.0, 0.6], "values": [0.1, -0.1], "interpolation": "hold"}},
        ),
        "slider-crank-free-shift": _case(
            "both freedoms free, spring and damper on the shift",
            drive={"torque": 5.0},
            axial={"force": {"kind": "harmonics", "amplitudes": [20.0], "frequencies": [6.0]}},
            shift={"stiffness": 500.0, "damping": 20.0},
        ),
        "slider-crank-groove": _case(
            "a groove makes the shift",
            drive={"torque": 5.0},
            axial={"groove": True},
            groove={"amplitude": 0.1, "ratio": 2.0},
        ),
        "slider-crank-general": _case(
            "general twist and masses, springs, dampers, friction, gravity, the other assembly",
            drive=_RPM_50,
            axial={"force": 3.0},
            guide={"twist": 4.0},
            crank={"cog_y": 0.02, "cog_z": -0.05, "product_xz": 0.02, "product_yz": -0.01},
            gravity={"y": -9.81, "z": 1.0},
            shift={"stiffness": 800.0},
            slider={
                "cog_x": 0.02,
                "cog_z": 0.03,
                "stiffness": 200.0,
                "spring_free_position": -1.0,
                "damping": 15.0,
                "coulomb_friction": 2.0,
            },
            assembly={"branch": -1},
        ),
    }
)
