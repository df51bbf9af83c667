"""The dependencies that the model description declares are those that the FMU has."""

from pathlib import Path
from xml.etree.ElementTree import Element

from .described import read_unknowns
from .models import MODES, Model
from .runner import run_in_process
from .test_description import ROWS

# nothing zero and nothing aligned, so that no dependency hides
MECHANISMS = {
    "FiveBarSlider": {
        "crank.mass": 0.3,
        "crank.cog_distance": 0.02,
        "crank.cog_angle": 0.4,
        "coupler.cog_angle": 0.3,
        "rocker.cog_angle": -0.2,
        "slider.guide_angle": 0.25,
        "slider.coulomb_friction": 0.5,
        "slider.friction_coefficient": 0.07,
        **{f"pin.{pin}_friction_radius": 1e-3 for pin in "ABCD"},
        "slider.spring_free_position": 0.001,
        "coupler.point_distance": 0.08,
        "coupler.point_angle": 0.5,
        "ground.inclination": 0.3,
        "initial.crank_angle": 0.7,
        "initial.slider_velocity": 0.1,
        "initial.slider_position": 0.004,
        "drive.torque": 0.6,
        "drive.acceleration": 30.0,
        "slider.force": 1.5,
        "load.fx": 2.0,
        "load.fy": -1.0,
    },
    "SliderCrank": {
        "guide.twist": 4.3,
        "crank.inertia": 0.9,
        "crank.cog_y": 0.04,
        "crank.cog_z": -0.03,
        "crank.product_xz": 0.02,
        "crank.product_yz": -0.01,
        "rod.cog_distance": 0.5,
        "slider.cog_x": 0.02,
        "slider.cog_y": -0.03,
        "slider.cog_z": 0.05,
        "slider.stiffness": 300.0,
        "slider.spring_free_position": 1.0,
        "slider.damping": 15.0,
        "slider.coulomb_friction": 0.5,
        "shift.stiffness": 500.0,
        "shift.spring_free_position": 0.02,
        "shift.damping": 12.0,
        "groove.amplitude": 0.06,
        "groove.ratio": 1.7,
        "gravity.x": 3.0,
        "gravity.y": -7.0,
        "gravity.z": 5.0,
        "initial.crank_angle": 0.7,
        "initial.shift_velocity": 0.3,
        "drive.torque": 6.0,
        "drive.acceleration": 9.0,
        "axial.force": 11.0,
        "axial.speed": -0.2,
        "axial.acceleration": 2.0,
        "slider.load": 14.0,
    },
}


def perturb_start(
    fmu: str, folder: str, mechanism: dict[str, float], modes: list[dict[str, int]]
) -> dict[str, list[str]]:
    """For all drives: which outputs at the start change with each parameter and input."""
    from bare_master import Fmu

    fmu = Fmu(fmu, folder)
    found = {}
    for mode in modes:
        base = fmu.instantiate().start(mechanism | mode)
        before = base.outputs()
        for name, variable in fmu.variables.items():
            if variable.causality == "output" or variable.kind != "Real":
                continue
            value = base.get(name)
            instance = fmu.instantiate().start(mechanism | mode | {name: value * 1.01 or 0.01})
            after = instance.outputs()
            found.setdefault(name, []).extend(n for n in before if before[n] != after[n])
            instance.free()
        base.free()
    return found


#: Outputs at the start that change with a parameter of the configuration, of those declared to.
MOVED = {
    "FiveBarSlider": {"slider.guide_angle": {"coupler.angle", "rocker.angle", "transmission.angle"}},
    "SliderCrank": {
        "guide.twist": {"slider.position", "slider_pin.y", "slider_pin.z", "transmission.angle", "assembly.margin"},
        "groove.amplitude": {"shift.position", "crank_pin.z", "slider.position"},
        "groove.ratio": {"shift.position", "crank_pin.z", "slider.position"},
        "initial.shift_position": {"shift.position", "crank_pin.z", "slider.position"},
    },
}


def test_outputs_at_the_start_change_only_with_what_they_declare(
    description: Element, fmu: Path, model: Model, tmp_path: Path
) -> None:
    declared = read_unknowns(description, "InitialUnknown")
    found = run_in_process(perturb_start, fmu, tmp_path, MECHANISMS[model.name], list(MODES[model.name].values()))
    rows = ROWS[model.name]
    assert set(found) == {name for name, causality, kind, *_ in rows if causality != "output" and kind == "Real"}
    for name, outputs in MOVED[model.name].items():
        assert set(found[name]) >= outputs, name
    undeclared = {
        (output, name)
        for name, outputs in found.items()
        for output in outputs
        if declared[output] is not None and name not in declared[output]
    }
    assert undeclared == set()
