"""Standard cases of the five-bar slider as tables of case files: the mechanism of Table 3.1 with every drive and load."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any, Mapping

_RPM_420 = {"speed": "420 rpm"}


def _case(title: str, **tables: Any) -> dict[str, Any]:
    run = {"stop_time": 0.4, "step": 1e-3}
    return {"title": title, "published": "table-3.1", "drive": _RPM_420, "run": run, **tables}


CASES: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "table-3.1": {
            "title": "Youssef, Table 3.1, with fig. 3.4's spring",
            "published": "table-3.1",
            "initial": {"crank_speed": "420 rpm"},
        },
        "constant-speed": _case("constant speed of 300 rpm", drive={"speed": "300 rpm"}),
        "speed-ramp": _case(
            "ramp of the speed from 100 to 420 rpm",
            drive={"speed": {"kind": "ramp", "start": 10.0, "end": "420 rpm", "from_time": 0.05, "to_time": 0.3}},
        ),
        "speed-jump": _case(
            "jumps of the speed",
            drive={
                "speed": {
                    "kind": "table",
                    "times": [0.0, 0.1, 0.25],
                    "values": [20.0, 40.0, 30.0],
                    "interpolation": "hold",
                }
            },
        ),
        "torque-switched-off": _case(
            "torsion bar of 1e8 dyn.cm, released at 1 rad", drive={"torque": {"kind": "torsion-bar", "torque": 10.0}}
        ),
        "induction-motor": _case(
            "run-up by an induction motor",
            drive={
                "torque": {
                    "kind": "induction-motor",
                    "breakdown_torque": 5.0,
                    "breakdown_slip": 0.2,
                    "synchronous_speed": 50.0,
                }
            },
        ),
        "control-force": _case(
            "harmonic control force on the slider",
            force={"kind": "harmonics", "mean": 1.0, "amplitudes": [5.0], "frequencies": [30.0], "phases": [0.3]},
        ),
        "load": _case(
            "load at the coupler point",
            load={
                "fx": 3.0,
                "fy": {"kind": "table", "times": [0.0, 0.2, 0.4], "values": [0.0, 5.0, -2.0], "interpolation": "cubic"},
            },
            coupler={"point_distance": 0.1, "point_angle": 0.4},
        ),
        "inclined-guide": _case("guide and ground inclined", slider={"guide_angle": 0.4}, ground={"inclination": 0.3}),
        "other-assembly": _case("the other assembly", assembly={"branch": -1}),
        "coulomb-friction": _case("Coulomb friction of 5 N in the guide", slider={"coulomb_friction": 5.0}),
        "contact-friction": _case(
            "friction in guide and pins by their forces",
            slider={"friction_coefficient": 0.2},
            pin={f"{name}_friction_radius": 1e-3 for name in "ABCD"},
        ),
    }
)
