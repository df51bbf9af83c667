"""Special points of branches against other continuation codes, AUTO-07p and jaxcont: what they gave, and now give."""

import numpy as np
import pytest

from analysis.periodic import Drive, Family, SpecialPoint, follow, newton_orbit, switch
from analysis.units import RAD_S_PER_RPM
from linkwork.five_bar.published import SETS
from tests.mechanisms import torsion
from tests.oracles import continued
from tests.published import CONTINUED

pytestmark = pytest.mark.usefixtures("registered")

RPM = RAD_S_PER_RPM


def oscillators(name: str) -> tuple[Family, list[float]]:
    """The family of a case in our terms: over the speed, or over the strength of the excitation at the speed 1."""
    if name == "duffing":
        springs = {"rotor_stiffness": 1.0, "rotor_cubic_stiffness": 0.04}
        parameters = torsion.Parameters(rotor_damping=0.1, **springs, rotor_excitation=1.0)
        return Family(parameters=parameters, drive=Drive(speed=1.0)), [0.0, 0.0]
    parameters = torsion.Parameters(rotor_damping=0.75, rotor_weight=2.25)
    family = Family(
        parameters=parameters,
        drive=Drive(speed=1.0),
        vary=lambda g: (
            torsion.Parameters(rotor_damping=0.75, rotor_weight=2.25, rotor_excitation=2.25 * g),
            Drive(speed=1.0),
        ),
    )
    return family, [-2.27, 2.0]


@pytest.fixture(scope="module")
def ours() -> dict[str, list[SpecialPoint]]:
    """Special points of the branches of `continued.CASES`, in their order."""
    found: dict[str, list[SpecialPoint]] = {}
    for name, ends in (("duffing", (0.9, 1.8)), ("pendulum", (1.06, 1.0823))):
        family, start = oscillators(name)
        case = continued.CASES[name]
        orbit = newton_orbit(*family.operation(case.begin), start=start)
        branch = follow(family, orbit, case.begin, low=ends[0], high=ends[1])
        found[name] = list(branch.special)
    for turns in (2, 4):
        branch = switch(family, found["pendulum" if turns == 2 else "pendulum, 2 turns"][0], low=ends[0], high=ends[1])
        found[f"pendulum, {turns} turns"] = list(branch.special)
    rig = SETS["rig-1-spring-b"].parameters
    family = Family(parameters=rig, drive=Drive(speed=1000.0 * RPM))
    for name in ("five-bar, small motion", "five-bar, large motion"):
        case = continued.CASES[name]
        scale = rig.crank_length * np.array([1.0, case.begin])
        orbit = newton_orbit(*family.operation(case.begin), start=scale * case.start)
        branch = follow(family, orbit, case.begin, low=case.low, high=case.high, direction=case.direction)
        found[name] = list(branch.special)
    case = continued.CASES["five-bar, 2 turns"]
    branch = switch(family, found["five-bar, large motion"][0], low=case.low, high=950.0 * RPM)
    found["five-bar, 2 turns"] = list(branch.special)
    return found


@pytest.mark.parametrize(
    ("code", "name"), [(code, name) for code, table in CONTINUED.items() for name in table], ids=lambda part: part
)
def test_special_points_are_those_that_other_codes_gave(
    ours: dict[str, list[SpecialPoint]], code: str, name: str
) -> None:
    compare(ours[name], CONTINUED[code][name])


def compare(ours: list[SpecialPoint], others: list[tuple[str, float]]) -> None:
    assert [special.kind.value for special in ours] == [kind for kind, _ in others]
    assert [special.parameter for special in ours] == pytest.approx([value for _, value in others], rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("package", continued.CODES)
@pytest.mark.filterwarnings("ignore")
def test_special_points_are_those_that_an_installed_code_gives(
    ours: dict[str, list[SpecialPoint]], package: str
) -> None:
    pytest.importorskip(package, reason="the extra 'continuation' is not installed")
    for name in ("duffing", "pendulum"):
        found = list(continued.CODES[package][0](continued.CASES[name]))
        # jaxcont sorts them by the parameter
        compare(sorted(ours[name], key=lambda special: special.parameter), sorted(found, key=lambda other: other[1]))
