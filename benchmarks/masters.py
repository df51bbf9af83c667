"""Find out which features of this project's FMUs each master uses, by runs with FMUs that log all calls.

    python -m benchmarks.masters                     # all masters, five minutes; writes docs/masters.csv
    python -m benchmarks.masters --master FMPy       # one of them (repeatable); prints its results

Each run is a process of its own, on Linux. `tests/fmu/spy.c` takes the place of an FMU's library; it logs each call and passes
it on to that library. `docs/generate.py` puts the table into docs/masters.md.
"""

import argparse
import os
import re
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from analysis.export import NATIVE, NATIVE_FMI3, build_native
from analysis.mechanisms import FIVE_BAR
from analysis.systems import write_ssp
from tests.fmu import masters as alone
from tests.fmu.runner import run_in_process
from tests.fmu.spy import changed, watched
from tests.fmu.test_masters import CASES, COMMANDED, STATES, STEPS
from tests.systems import masters as together
from tests.systems.conftest import started_in_its_modes, system_of

from . import tables

RESULTS = Path(__file__).parents[1] / "docs" / "masters.csv"
YES, NO, NONE = "yes", "no", "-"


class Run(NamedTuple):
    """A run of a master on an FMU or archive.

    ``on`` is the name of the FMU or archive, see `material`; ``by`` is the function that runs the master. ``label`` names the
    option of the master that is used, or is `YES` without an option. If the run must fail, ``fails`` is a part of the master's
    message.
    """

    on: str
    by: Callable[..., Any]
    arguments: tuple[Any, ...] = ()
    label: str = YES
    fails: str = ""


_SYSTEM = (5e-4, 20, ["linkage.crank.angle"])
_BOND = ["motor.shaft.exerted_torque", "linkage.drive.torque", "linkage.crank.speed", "motor.flangeDrive.speed"]
_FREE, _COMMANDED = ([*cases["FiveBarSlider"][:4]] for cases in (CASES, COMMANDED))
_LIMIT = [*_FREE[:3], CASES["FiveBarSlider"].too_much]
_OUTPUTS = ["crank.angle"]


def _alone(on: str, by: Callable[..., Any], case: Any = _FREE, interface: str = STEPS, label: str = YES) -> Run:
    return Run(on, by, (case, _OUTPUTS, interface), label)


def _system(by: Callable[..., Any], label: str = YES, *option: Any, on: str = "archive") -> Run:
    return Run(on, by, (*_SYSTEM, *option), label)


def _exchange(by: Callable[..., Any]) -> list[Run]:
    return [_alone("jump", by, interface=STATES), _alone("limit", by, _LIMIT, STATES)]


#: The runs of each master. A master that never sets integers runs FMUs that have the values of their modes as start values.
RUNS = {
    "FMPy": [
        _system(together.by_fmpy, YES, False),
        _system(together.by_fmpy, "`parameter_set`", True),
        _system(together.by_fmpy, on="wrong"),
        _alone("FMI 2.0", alone.by_fmpy_with, interface="fmu_state", label="`fmu_state`"),
        _alone("FMI 2.0", alone.by_fmpy_with, interface="set_input_derivatives")._replace(
            fails="sequence of same size"
        ),
        _alone("FMI 3.0", alone.by_fmpy),
        _alone("FMI 3.0", alone.by_fmpy_with, interface="early_return_allowed", label="`instantiate_fmu`"),
        *_exchange(alone.by_fmpy),
    ],
    "libcosimpy": [
        _system(together.by_libcosimpy),
        Run("archive", together.by_ecco, (0.01, 1e-6, _BOND, []), "ECCO"),
        _system(together.by_libcosimpy, on="wrong"),
        _alone("FMI 3.0", alone.by_libcosimpy)._replace(fails="ended with -"),
    ],
    "ecospy": [
        _system(together.by_ecospy),
        _system(together.by_ecospy, on="wrong"),
        _alone("FMI 3.0", alone.by_ecospy),
    ],
    "CoFMUPy": [
        _system(together.by_cofmupy, on="started"),
        _system(together.by_cofmupy, "`iterative`", True, on="started"),
        _system(together.by_cofmupy, on="wrong"),
        _alone("FMI 3.0", alone.by_cofmupy, _COMMANDED),
    ],
    "PathSim": [
        _system(together.by_pathsim),
        _system(together.by_pathsim, on="wrong"),
        _alone("FMI 3.0", alone.by_pathsim, _COMMANDED),
        *_exchange(alone.by_pathsim),
    ],
    "`run_system`": [
        _system(together.by_linkwork),
        *(_system(together.by_linkwork, f'`"{c}"`', c) for c in ("derivatives", "rollback")),
        _system(together.by_linkwork, "`share`", "hold", 1e-3),
        _system(together.by_linkwork, '`"updates"`', "updates", on="archive 3"),
        _system(together.by_linkwork, on="wrong")._replace(fails="the units do not match"),
    ],
}
#: Functions of masters that read an archive themselves.
READERS = (together.by_fmpy, together.by_libcosimpy, together.by_ecospy, together.by_linkwork)


class Capability(NamedTuple):
    """A capability of a master, and how a run shows it."""

    name: str
    on: tuple[str, ...]  # names of the FMUs and archives whose runs are examined
    line: str  # line of the result of `lines` that shows the capability


_FMI2 = ("archive", "started", "FMI 2.0")
_FMI3 = ("archive 3", "FMI 3.0")
CAPABILITIES = (
    Capability("reads the `.ssp`", ("archive", "started"), "read"),
    Capability("sets integers", _FMI2, "fmi2SetInteger"),
    Capability("refuses a torque wired to a force", ("wrong",), "refused"),
    Capability("varies its step", ("archive", "started"), "variedStep"),
    Capability("sets a saved state", _FMI2, "fmi2SetFMUstate"),
    Capability("derivatives of inputs", _FMI2, "fmi2SetRealInputDerivatives"),
    Capability("FMI 3.0: intermediate update", _FMI3, "intermediateUpdate"),
    Capability("FMI 3.0: early return", _FMI3, "earlyReturn"),
    Capability("model exchange: event at a jump of an input", ("jump",), "fmi2EnterEventMode"),
    Capability("model exchange: event at the limit of assembly", ("limit",), "fmi2EnterEventMode"),
)


def _cross(folder: Path) -> None:
    """Connect the torque of the shaft to the force on the slider, in the folder of an unpacked archive."""
    # changed in the text, not as XML, because two of the masters recognise elements only by their prefixes
    path = folder / "SystemStructure.ssd"
    text = path.read_text(encoding="utf-8").replace('"drive.torque"', '"slider.force"')
    text, count = re.subn(r'(name="slider\.force"[^>]*>\s*<ssc:Real) unit="N\.m"', r"\1", text)
    assert count == 1
    path.write_text(text, encoding="utf-8")


def _watch(folder: Path) -> None:
    for fmu in (folder / "resources").glob("*.fmu"):
        watched(fmu, fmu)


def material(folder: Path, on: str) -> Path:
    """Return the path of the FMU or archive of this name, which logs all calls; make it if it is not in the folder."""
    name = {"jump": "FMI 2.0", "limit": "FMI 2.0"}.get(on, on)
    alone = name.startswith("FMI")
    target = folder / f"{name}.{'fmu' if alone else 'ssp'}"
    if target.exists():
        return target
    if alone:
        return watched(build_native(FIVE_BAR, NATIVE if name == "FMI 2.0" else NATIVE_FMI3, folder), target)
    if name == "wrong":
        return changed(material(folder, "archive"), target, _cross)
    if name == "started":
        wiring = started_in_its_modes("motor-crank", folder)
    else:
        wiring = system_of("motor-crank").without_rates().wiring(fmi=3 if name == "archive 3" else 2)
    return changed(write_ssp(wiring, folder / "unwatched.ssp"), target, _watch)


def lines(run: Run, material: Path) -> set[str]:
    """Run a master; return the calls that it makes, with "read" if it reads archives, "refused" if it refuses the units."""
    with tempfile.TemporaryDirectory() as folder:
        calls = Path(folder, "calls")
        calls.touch()
        os.environ["LINKWORK_CALLS"] = str(calls)
        try:
            run_in_process(run.by, material, *run.arguments, options=(), timeout=300.0)
        except AssertionError as error:
            if run.fails not in str(error) or not run.fails:
                raise
            found = {"refused"} if "units" in run.fails else set()
        else:
            found = {"read"} if run.by in READERS else set()
        finally:
            del os.environ["LINKWORK_CALLS"]
        return found | set(calls.read_text(encoding="utf-8").split())


def find(master: str, folder: Path) -> dict[str, str]:
    """Return for each capability of a master `YES`, the option that it needs, `NO`, or `NONE` if no run can show it."""
    told = [(run, lines(run, material(folder, run.on))) for run in RUNS[master]]
    found = {}
    for capability in CAPABILITIES:
        looked = [(run.label, said) for run, said in told if run.on in capability.on and said]
        labels = [label for label, said in looked if capability.line in said]
        found[capability.name] = labels[0] if labels else NO if looked else NONE
    return found


Table = dict[str, dict[str, str]]


def read(path: Path) -> Table:
    """Read the table of results, by master and capability."""
    return {row.pop("master"): row for row in tables.read(path)}


def markdown(table: Table) -> str:
    """Return the table in Markdown, with a column for each master."""
    return tables.markdown(["", *table], ((c.name, *(found[c.name] for found in table.values())) for c in CAPABILITIES))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--master", choices=tuple(RUNS), action="append", help="run only this master (repeatable)")
    chosen = parser.parse_args().master
    with tempfile.TemporaryDirectory() as place:
        table = {master: find(master, Path(place)) for master in chosen or RUNS}
    if not chosen:
        headings = ["master", *(c.name for c in CAPABILITIES)]
        tables.write(RESULTS, headings, ([master, *found.values()] for master, found in table.items()))
    print(markdown(table))
