"""Systems of the library, wired once."""

from __future__ import annotations

from functools import cache

from analysis.systems import System, Wiring, library, load_system


@cache
def system_of(name: str) -> System:
    return load_system(library()[name])


@cache
def wiring_of(name: str) -> Wiring:
    return system_of(name).wiring()
