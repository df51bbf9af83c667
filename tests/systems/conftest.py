"""Systems of the library for the tests, loaded and wired once."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

from analysis.export import NATIVE, build_native, with_starts
from analysis.systems import System, Wiring, library, load_system
from analysis.systems.wiring import Part


@cache
def system_of(name: str) -> System:
    return load_system(library()[name])


@cache
def wiring_of(name: str) -> Wiring:
    return system_of(name).wiring()


def started_in_its_modes(name: str, folder: Path) -> Wiring:
    """Return a system without rates for masters that set no integers: its FMUs contain all their start values."""
    wiring, parts = system_of(name).without_rates().wiring(), {}
    for part, member in system_of(name).members.items():
        assert member.mechanism is not None
        fmu = build_native(with_starts(member.mechanism, member.values), NATIVE, folder)
        parts[part] = Part.from_fmu(part, fmu, member.values)
    return replace(wiring, parts=parts)
