"""Tables of mechanisms for the page, made from the registry, so that the page itself knows no mechanism."""

from __future__ import annotations

import base64
import gzip
import math
import re
from typing import Any

from linkwork.mechanism import Mechanism, PublishedSet
from linkwork.parameters import field_name
from linkwork.variables import UNITS, Variable

from ..export import Entry, build_web, crank_index, interface
from ..mechanisms import name_in_files
from ..periodic import OF_A_RUN, Drive, damping_name, find_crank, free_position_name, motor_parameters, stiffness_name

#: Section of the page for a parameter, by its role or, if the role has none, by its unit; all other parameters are dimensions.
_SECTIONS = {
    "gravity": "Gravity",
    **dict.fromkeys(("stiffness", "damping", "friction", "spring", "law"), "Spring, damper, friction"),
    **dict.fromkeys(("centre of mass", "kg", "kg.m2"), "Masses"),
}
DRIVE = "Drive and loads"
#: Fields of a motor that is not given: no torque, a usual slip, and the speed of four poles at 50 Hz (rad/s).
NO_MOTOR = {"breakdown_torque": 0.0, "breakdown_slip": 0.2, "synchronous_speed": 50.0 * math.pi}
#: Tolerance of a run on the page, smaller than the default of other runs.
TOLERANCE = 1e-12


def mechanism_tables(mechanism: Mechanism) -> dict[str, Any]:
    """Return the tables of a mechanism for the page, and its WebAssembly module."""
    entries = interface(mechanism)
    reference = {entry.variable.name: entry.reference for entry in entries}
    outputs = {v.name: v for v in mechanism.variables if v.name in mechanism.output_names}
    names = list(mechanism.output_names)
    crank = crank_index(mechanism)
    return {
        "name": mechanism.name,
        "title": mechanism.title,
        # a described linkage has its description as a set of its own name
        "described": mechanism.name in mechanism.published,
        "module": base64.b64encode(
            gzip.compress(build_web(mechanism, _coupled_turns(mechanism, crank)), 9, mtime=0)
        ).decode(),
        "given": [_entry_rows(mechanism, entry.variable, entry.reference) for entry in given_entries(mechanism)]
        + _motor(mechanism, crank),
        "outputs": [
            {"name": name, "text": v.description, **({"run": True} if name in OF_A_RUN else {}), **_unit(v)}
            for name, v in outputs.items()
        ],
        "freedoms": [
            {
                "coordinate": names.index(freedom.coordinate),
                "rate": names.index(freedom.rate),
                "initial": [reference[f"initial.{name}"] for name in freedom.initial],
                "mode": -1 if freedom.mode is None else reference[freedom.mode.name],
                "period": freedom.period,
            }
            for freedom in mechanism.freedoms
        ],
        "crank": crank,
        "states": mechanism.size,
        "tolerance": [reference["solver.tolerance"], TOLERANCE],
        "picture": _picture(mechanism, reference),
        "moving": [names.index(name) for name in _outputs_with_rates(mechanism)],
        "charts": _charts(mechanism),
        "natural": _stiffness_reference(mechanism, reference, crank),
        "damping": damping_name(mechanism)
        if crank >= 0 and len(mechanism.freedoms) > 1 and mechanism.names("damping")
        else "",
        "transmission": [names.index(name) for name in mechanism.names("transmission")],
        "sets": [
            {"name": name, "source": known.source, "values": published_values(mechanism, known)}
            for name, known in mechanism.published.items()
        ],
    }


def published_values(mechanism: Mechanism, known: PublishedSet) -> dict[str, float]:
    """Return the values of a published set, with the speeds at which the set is driven, by FMI name."""
    return fmi_starts(mechanism, known.parameters, known.initial) | {
        channel.name: known.drive[channel.argument] for channel in mechanism.channels if channel.argument in known.drive
    }


def fmi_starts(mechanism: Mechanism, parameters: Any, initial: Any) -> dict[str, float]:
    """Return the values of parameters and initial state by FMI name."""
    own = {name: getattr(parameters, field_name(name)) for name in mechanism.mechanism_variables}
    start = {variable.name: getattr(initial, name) for name, variable in mechanism.initial_variables.items()}
    return {name: float(value) for name, value in (own | start).items()}


def shown_unit(variable: Variable) -> tuple[str, float]:
    """Return the unit in which the page shows a variable, and the factor from SI to this unit."""
    displays = dict(UNITS[variable.unit].displays) if variable.kind == "Real" else {}
    shown = variable.display or ("" if variable.unit == "rad/s" else next(iter(displays), ""))
    unit = shown or variable.unit
    return "" if unit == "1" else unit, displays.get(unit, 1.0)


def _unit(variable: Variable) -> dict[str, Any]:
    return dict(zip(("unit", "factor"), shown_unit(variable)))


def given_entries(mechanism: Mechanism) -> list[Entry]:
    """Return the entries of the interface that the page can set, without those of a motor and without rates of inputs."""
    rates = [channel.name for channel in mechanism.channels if channel.kind == "rate"]
    roles = ("parameter", "mode", "initial", "input")
    return [one for one in interface(mechanism) if one.role in roles and one.variable.name not in rates]


def _entry_rows(mechanism: Mechanism, variable: Variable, reference: int) -> dict[str, Any]:
    mode = next((mode for mode in mechanism.modes if mode.name == variable.name), None)
    channel = next((channel for channel in mechanism.channels if channel.name == variable.name), None)
    row: dict[str, Any] = {
        "name": variable.name,
        "reference": reference,
        "text": variable.description,
        "start": float(variable.start),
        "section": DRIVE if mode or channel else _section(mechanism, variable),
        **_unit(variable),
    }
    least = None if variable.minimum is None else float(variable.minimum)
    there = {"least": least, "nominal": variable.nominal, "role": variable.role or None}
    row |= {name: value for name, value in there.items() if value is not None}
    if mode is not None:
        row["choices"] = {str(value): words for value, words in enumerate(mode.values)}
        row["arguments"] = list(mode.arguments)
    elif variable.kind == "Integer":
        row["choices"] = {"1": "+1", "-1": "-1"}
    if channel is not None:
        row["file"] = name_in_files(mechanism, channel)
        row |= {"argument": channel.argument, "kind": channel.kind, "freedom": channel.freedom}
    return row


def _motor(mechanism: Mechanism, crank: int) -> list[dict[str, Any]]:
    """Return table rows for the values of a motor on the crank; empty if the crank has no torque input.

    In the page's module these values have negative references.
    """
    torque = find_crank(mechanism, mechanism.freedoms[crank].coordinate).torque if crank >= 0 else None
    if torque is None:
        return []
    own = mechanism.channels[torque].name
    numbers = {name: what for name, what in motor_parameters(mechanism).items() if name.startswith(f"{own}.")}
    return [
        {
            "name": name,
            "reference": -1 - number,
            "text": f"{field.replace('_', ' ').capitalize()} of an induction motor on the crank",
            "start": NO_MOTOR[field],
            "section": DRIVE,
            "unit": "rpm" if unit == "rad/s" else "" if unit == "1" else unit,
            "factor": dict(UNITS[unit].displays)["rpm"] if unit == "rad/s" else 1.0,
            "nominal": 1.0,
            "argument": mechanism.channels[torque].argument,
            "kind": "motor",
            "file": field,
        }
        for number, (name, (field, unit)) in enumerate(numbers.items())
    ]


def _coupled_turns(mechanism: Mechanism, crank: int) -> dict[int, float]:
    """Return, by index, the turns of each free rotation that springs couple to the crank, per turn of the crank."""
    if crank < 0:
        return {}
    forces = {c.name: 0.0 for c in mechanism.channels if c.kind == "force" and c.freedom not in (-1, crank)}
    drive = Drive(speed=1.0, crank=mechanism.freedoms[crank].coordinate, forces=forces)
    return {n: float(ratio) for n, ratio in drive.ratios_by_freedom(mechanism).items()}


def _stiffness_reference(mechanism: Mechanism, reference: dict[str, int], crank: int) -> int | None:
    """Return the value reference of the stiffness from which the page computes the natural frequency, at the coordinate 0.

    The result is None if the mechanism has no such frequency: see `analysis.periodic.natural_frequency`.
    """
    own, variables = stiffness_name(mechanism), mechanism.mechanism_variables
    others = {*mechanism.names("stiffness"), free_position_name(mechanism, own)} - {own, ""}
    if crank < 0 or any(variables[name].start for name in others):
        return None
    return reference.get(own)


def _section(mechanism: Mechanism, variable: Variable) -> str:
    if variable in mechanism.initial_variables.values():
        return "Start"
    return _SECTIONS.get(variable.role) or _SECTIONS.get(variable.unit, "Dimensions")


def _picture(mechanism: Mechanism, reference: dict[str, int]) -> dict[str, Any]:
    drawing = mechanism.drawing
    if drawing is None:
        return {"joints": [], "parts": [], "paths": [], "planar": True}
    number = {joint.name: n for n, joint in enumerate(drawing.joints)}
    return {
        "joints": [
            {
                "name": joint.name,
                "text": joint.text,
                "moves": [reference[name] for name in joint.moves],
                **({"aid": True} if joint.aid else {}),
            }
            for joint in drawing.joints
        ],
        "parts": [
            part._asdict()
            | {
                "joints": [number[name] for name in part.joints],
                "where": reference[part.where] if part.where else -1,
            }
            for part in drawing.parts
        ],
        "paths": [number[name] for name in drawing.paths],
        "planar": drawing.planar,
    }


def _outputs_with_rates(mechanism: Mechanism) -> list[str]:
    """Return the names of the outputs that have a rate and an acceleration, except crank angles."""
    rate_of = {v.rate_of: v.name for v in mechanism.variables if v.rate_of}
    crank = [mechanism.freedoms[n].coordinate for n in mechanism.cyclic_freedoms]
    return [n for n in mechanism.output_names if n in rate_of and rate_of[n] in rate_of and n not in crank]


def _charts(mechanism: Mechanism) -> list[dict[str, Any]]:
    """Return the charts of the page.

    The entry ``of`` of a curve lists indices of outputs. A curve with several outputs shows the magnitude of the vector whose
    components they are. Powers have the indices after all outputs and all coordinates of joints: see studio.c.
    """
    names, variables = list(mechanism.output_names), {v.name: v for v in mechanism.variables}
    power = len(names) + 3 * len(mechanism.drawing.joints if mechanism.drawing else ())
    watt = {"unit": "W", "factor": 1.0}

    def outputs(title: str, kind: str, output_names: list[str]) -> dict[str, Any]:
        unit = _unit(variables[output_names[0]]) if output_names else watt
        curves = [{"name": n, "of": [names.index(n)]} for n in output_names]
        return {"title": title, "kind": kind, **unit, "curves": curves}

    forces = [{"name": joint, "of": [names.index(name) for name in parts]} for joint, parts in mechanism.joints.items()]
    turning = [
        name for n in mechanism.cyclic_freedoms for name in mechanism.names("drive", mechanism.freedoms[n].coordinate)
    ]
    powers = [{"name": "of drives and loads", "of": [power + 1]}, {"name": "lost", "of": [power]}]
    # one chart for each unit; a curve that is alone has no legend
    moving: dict[str, list[str]] = {}
    for name in _outputs_with_rates(mechanism):
        moving.setdefault(shown_unit(variables[name])[0], []).append(name)
    found = [
        *(
            outputs("Motion" if len(of) > 1 else f"Motion: {re.sub('[._]', ' ', of[0])}", "motion", of)
            for of in moving.values()
        ),
        outputs("Torque of the drive", "motion", turning),
        {"title": "Forces in the joints", "kind": "forces", "unit": "N", "factor": 1.0, "curves": forces},
        {"title": "Power", "kind": "power", **watt, "curves": powers},
        outputs("Transmission angle", "power", list(mechanism.names("transmission"))),
    ]
    return [chart for chart in found if chart["curves"]]
