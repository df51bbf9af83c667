"""`linkwork new`: write a case file to start from. The entries are taken from the code that reads such a file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from linkwork.mechanism import Mechanism
from linkwork.parameters import field_name

from ..mechanisms import MECHANISMS
from .common import report_errors, say, unknown_name_error

SLIDER_MOTION = "slider-motion"
TUNING = "tuning"
LINKAGE = "linkage"
_HEAD = """\
# {title}: {command} {file}
# Every quantity is a number in SI or a text with its unit, such as "5 cm" or "420 rpm". Entries behind a # may be left out:
# they show their defaults or examples.
"""
#: Entries of an example task of each kind, which can be solved within seconds; all other entries get their defaults.
_TASKS: Mapping[str, Mapping[str, Any]] = {
    "timed-path": {"x": "20 + 10*cos(t)", "y": "15 + 5*sin(t)", "unit": "cm", "n": 72},
    "untimed-path": {"x": "20 + 10*cos(t)", "y": "15 + 5*sin(t)", "unit": "cm", "n": 72},
    "rocker-function": {"angle": "70 + 100*abs(sin(t/2))", "angle_unit": "deg", "n": 24, "mounting": True},
    "slider-function": {"position": "40*cos(t) + 5*cos(2*t)", "unit": "mm", "n": 36},
    "quick-return": {"stroke": "80 mm", "time_ratio": 1.2},
    "motion": {
        "points": [[0, 0], [20, 15], [40, 20], [60, 15], [80, 0]],
        "unit": "mm",
        "angle": [0, 8, 15, 22, 30],
        "angle_unit": "deg",
    },
    "precision-points": {"points": [[0, 0], [20, 15], [40, 20], [60, 15], [80, 0]], "unit": "mm"},
}
_CONSTRAINTS: Mapping[str, Any] = {"largest_link": "1 m", "least_transmission_angle": "30 deg"}
#: Examples of entries that have no default, or none that shows their use, by table.
_REQUIRED: Mapping[str, Mapping[str, Any]] = {
    "trade_off": {"over": "size", "limits": ["50 cm", "1 m"]},
    "strategy": {"tolerance": "1 deg"},
    "drive": {"speed": "120 rpm"},
    "slider": {"harmonics": [2], "stroke": "60 mm"},
}


#: Entries of an example of tuning, which succeeds within seconds.
_WISH: Mapping[str, Any] = {
    "speeds": ["570 rpm", "600 rpm"],
    "change": {"slider.stiffness": "10 %"},
    "no_resonance": True,
}


#: Cross section of the links of a new case, from which the masses of the links follow.
_SECTION = {"kind": "bar", "width": "30 mm", "thickness": "8 mm", "material": "steel"}
_OF_SECTIONS = """\
# Masses, centres of mass and moments of inertia of {links} follow from their lengths and sections: give
# your own sections, or the numbers behind a # instead. A measured mass may be given in addition to a section.
{kinds}
#   materials: {materials}, or a density such as "7.85 g/cm3"; overhang: material beyond each pin
# All other numbers, such as {other}, are those of {source}: give your own."""


def kinds() -> dict[str, str]:
    """Return the kinds of files that `linkwork new` writes, each with the command that reads such a file."""
    runs = dict.fromkeys(MECHANISMS, "linkwork run")
    return (
        runs
        | dict.fromkeys(_TASKS, "linkwork synthesize")
        | {SLIDER_MOTION: "linkwork slider-motion", TUNING: "linkwork tune", LINKAGE: "linkwork linkage"}
    )


def case_text(kind: str, file: str, *, parameters: bool = False) -> str:
    """Return the text of a new case file of a kind; with ``parameters`` only the parameters of a mechanism.

    ``file`` is the name of the file that will contain the text.
    """
    if kind == LINKAGE:
        from ..linkages import TEXT

        return TEXT.replace("{file}", file)
    if kind in MECHANISMS:
        mechanism = MECHANISMS[kind]
        command = f"linkwork {kind if kind == 'slider-crank' else ''} info".replace("  ", " ")
        title, lines = mechanism.title, _parameter_file(mechanism)
        if not parameters:
            command, title, lines = "linkwork run", f"A run of the {kind}", _run_case(mechanism, file)
    else:
        titles = {SLIDER_MOTION: "A motion of the slider", TUNING: "A tuning"}
        command, title = kinds()[kind], titles.get(kind, f"A synthesis, {kind}")
        lines = _tuning_case(file) if kind == TUNING else _synthesis_case(kind, file)
    return _HEAD.format(title=title, command=command, file=file) + "\n".join(lines) + "\n"


def _group_by_table(rows: Mapping[str, str]) -> Iterator[str]:
    """Yield the lines ``rows`` grouped by table, with headings; lines whose names have no table come first."""
    for group in dict.fromkeys(sorted((name.rpartition(".")[0] for name in rows), key=bool)):
        if group:
            yield f"\n[{group}]"
        yield from (text for name, text in rows.items() if name.rpartition(".")[0] == group)


def _value(variable: Any, value: Any) -> Any:
    from ..files import in_words

    if variable.kind == "Integer":
        return int(value)
    return float(value) if variable.unit == "1" else in_words(value, variable.unit)


def _parameter_rows(mechanism: Mechanism, *, sections: bool) -> dict[str, str]:
    """Return the lines of the parameters of a mechanism's first published set, by name.

    With ``sections`` there are lines for the cross sections of links; the masses that follow from them are comments.
    """
    from ..files import line
    from ..run import read_parameters

    made = mechanism.first_set.parameters
    rows = {}
    computed = set()
    for link in mechanism.links if sections else ():
        computed |= {link.mass, link.inertia, *link.centre}
        rows[f"{link.name}.section"] = line("section", _SECTION, "", active=True)
        made = read_parameters({f"{link.name}.section": _SECTION}, made)
    return rows | {
        name: line(
            name.rpartition(".")[2],
            _value(v, getattr(made, field_name(name))),
            v.description,
            active=name not in computed,
        )
        for name, v in mechanism.mechanism_variables.items()
    }


def _mass_comments(mechanism: Mechanism) -> str:
    """Return comments for a new case file: how to give the links' cross sections, and the source of the other numbers."""
    from ..linkages import SECTIONS
    from ..sections import DENSITIES

    own = {link.mass for link in mechanism.links}
    other = [v.name for v in mechanism.mechanism_variables.values() if v.unit in ("kg", "N/m") and v.name not in own]
    return _OF_SECTIONS.format(
        links=", ".join(link.name for link in mechanism.links),
        kinds="\n".join(f"#   {kind}: {', '.join(table.readers)}" for kind, table in SECTIONS.items()),
        materials=", ".join(DENSITIES),
        other=", ".join(other),
        source=mechanism.first_set.source,
    )


def _parameter_file(mechanism: Mechanism) -> Iterator[str]:
    source = mechanism.first_set.source
    yield f"# All numbers, masses too, are those of {source}: give your own."
    yield f'mechanism = "{mechanism.name}"'
    yield from _group_by_table(_parameter_rows(mechanism, sections=False))


def _run_case(mechanism: Mechanism, file: str) -> Iterator[str]:
    """Yield the lines of a new case file: a run of the first published set, for three turns, or 1 s if the set has no drive."""
    from ..files import entries, in_words, line
    from ..run import RunTable, case_inputs, signal_kinds

    published = mechanism.first_set
    meaning = {v.name: v.description for v in mechanism.variables}
    words = {c.argument: meaning[c.name] for c in mechanism.channels}
    yield "# An input may vary: it is then a table with a kind, such as speed = { kind = ..., ... }."
    of_torques = set(signal_kinds("N.m", Path())) - set(signal_kinds("N", Path()))
    for kind, table in signal_kinds("N.m", Path()).items():
        yield f"#   {kind}{' (of torques)' if kind in of_torques else ''}: {', '.join(table.readers)}"
    if mechanism.links:
        yield _mass_comments(mechanism)
    yield f'mechanism = "{mechanism.name}"'
    yield line("title", Path(file).stem, "of tables and pictures", active=True)
    rows = _parameter_rows(mechanism, sections=True)
    start = mechanism.initial()
    for name, v in mechanism.initial_variables.items():
        value = getattr(published.initial, name)
        active = value != getattr(start, name)
        rows[f"initial.{name}"] = line(name, _value(v, value), v.description, active=active)
    for name, (argument, unit) in case_inputs(mechanism).items():
        leaf = name.rpartition(".")[2]
        if not unit:
            rows[name] = line(leaf, True, "true or false, instead of the other entries of its table", active=False)
            continue
        driven = argument in published.drive
        value = published.drive.get(argument, 1.0)
        rows[name] = line(leaf, in_words(value, unit), words[argument], active=driven)
    given: dict[str, Any] = {"revolutions": 3.0} if published.drive else {"stop_time": "1 s"}
    yield from _group_by_table(rows)
    yield "\n[run]"
    yield from entries(RunTable, given)


def _tuning_case(file: str) -> Iterator[str]:
    from ..files import entries, line
    from ..tuning import TuneTable

    yield "# The mechanism and its inputs are given as for a run: see linkwork new five-bar."
    yield 'published = "rig-2-spring-c"'
    yield line("title", Path(file).stem, "of tables and pictures", active=True)
    yield "\n[tune]"
    yield from entries(TuneTable, _WISH)


def _synthesis_case(kind: str, file: str) -> Iterator[str]:
    """Yield the lines of a new case file: a synthesis task; for the kind `SLIDER_MOTION` with a motion of the slider."""
    from ..files import Quantity, entries, line
    from ..slider import TABLES as MOTION
    from ..synthesis import BOUNDS, KINDS, TABLES, UNITS

    moved = kind == SLIDER_MOTION
    task = "rocker-function" if moved else kind
    yield line("title", Path(file).stem, "of tables and pictures", active=True)
    yield "\n[task]"
    yield f'kind = "{task}"'
    yield from entries(KINDS[task], _TASKS[task])
    if moved:
        yield "\n# The linkage whose pivot is moved; without this table it is found first."
        yield "# [linkage]"
        dimensions = {name: Quantity(unit) for name, unit in UNITS.items()}
        yield from entries(dict, {}, readers=dimensions)
    yield "\n# The dimensions: [least, greatest], or one value that fixes it."
    yield "# [bounds]"
    yield from entries(dict, {}, readers=BOUNDS.readers)
    active = {"constraints": _CONSTRAINTS, "slider": _REQUIRED["slider"]}
    for name, table in {**TABLES, **(MOTION if moved else {})}.items():
        if moved and name == "trade_off":
            continue
        used = name in active
        yield f"\n{'' if used else '# '}[{name}]"
        given: Mapping[str, Any] = active.get(name) or _REQUIRED.get(name, {})
        yield from entries(table, given, active=used)


@click.command()
@click.argument("kind", metavar="KIND", required=False)
@click.argument("file", required=False, type=click.Path(dir_okay=False))
@click.option(
    "--parameters", is_flag=True, help="For a mechanism: only its parameters, as 'linkwork slider-crank' reads them."
)
@click.option("--force", is_flag=True, help="Overwrite a file of the same name.")
@report_errors
def new(kind: str | None, file: str | None, parameters: bool, force: bool) -> None:
    """Write a case file to start from, with every entry explained. It runs without changes. Without KIND, list the kinds.

    KIND is a mechanism (for a run), a synthesis task, "slider-motion", "tuning", or "linkage" (for a linkage of your own).

    \b
    Examples:
      linkwork new
      linkwork new five-bar
      linkwork new rocker-function wiper.toml
      linkwork new slider-crank mine.toml --parameters
    """
    known = kinds()
    if kind is None:
        for name, command in known.items():
            say(f"{name:<18} for {command}")
        return
    if kind not in known:
        raise unknown_name_error(kind, known, f"kind of case {kind!r}")
    if parameters and kind not in MECHANISMS:
        raise click.UsageError(f"--parameters is for a mechanism, {' or '.join(MECHANISMS)}: {kind} is a task")
    path = Path(file or f"{kind}.toml")
    if path.suffix != ".toml":
        raise click.UsageError(f"{path} must end in .toml: JSON has no comments")
    if path.exists() and not force:
        raise click.UsageError(f"{path} is there already: give --force to write over it, or another name")
    text = case_text(kind, str(path), parameters=parameters)
    path.write_text(text, encoding="utf-8")
    say(f"wrote {path}; next: {text.partition(': ')[2].splitlines()[0]}")
