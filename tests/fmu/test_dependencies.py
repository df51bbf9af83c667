"""The dependencies that the model description declares are those that the FMU has."""

from pathlib import Path
from xml.etree.ElementTree import Element

from .bare_master import Fmu
from .described import read_unknowns
from .drawn import drawn
from .models import MODES, Model
from .runner import run_in_process
from .test_description import ROWS


def perturb_start(fmu: str, folder: str, cases: list[dict[str, float]]) -> dict[str, list[str]]:
    """For all drives: which outputs at the start change with each parameter and input."""
    fmu = Fmu(fmu, folder)
    found = {}
    for case in cases:
        base = fmu.instantiate().start(case)
        before = base.outputs()
        for name, variable in fmu.variables.items():
            if variable.causality == "output" or variable.kind != "Real":
                continue
            value = base.get(name)
            instance = fmu.instantiate().start(case | {name: value * 1.01 or 0.01})
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
    # successive seeds go through all modes
    cases = [drawn(model.name, seed).values for seed in range(len(MODES[model.name]))]
    found = run_in_process(perturb_start, fmu, tmp_path, cases)
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
