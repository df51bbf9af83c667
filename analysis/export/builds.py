"""Build every kind of FMU of every mechanism, as ``linkwork build`` does."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from ..files import unknown_name
from ..mechanisms import MECHANISMS
from .archive import run_trial
from .compatibility import publish
from .description import KINDS, PYTHON
from .native_fmu import EVERYWHERE, PLATFORMS, WASM, build_native, this_platform
from .python_fmu import build

#: The name that stands for all platforms.
ALL = "all"


class BuiltFmu(NamedTuple):
    """An FMU that was built: its path, and the platforms of its native libraries."""

    path: Path
    platforms: tuple[str, ...]


def build_all(
    models: Sequence[str] = (),
    dest: Path | str = "build",
    kinds: Sequence[str] = (),
    platforms: Sequence[str] = (),
    *,
    publish_to: Path | str | None = None,
) -> Iterator[BuiltFmu]:
    """Build FMUs one after the other; validate each, and try it out if it can run on this platform.

    Parameters
    ----------
    models : sequence of str, optional
        Names of FMUs, such as ``FiveBarSlider``; those of all mechanisms by default.
    dest : path
        Folder for the FMUs; made if it is not there.
    kinds : sequence of str, optional
        Names in `KINDS`; by default all.
    platforms : sequence of str, optional
        Platforms for which native FMUs are compiled: names in `PLATFORMS`, or ``all``; by default this platform. `WASM` is
        only for FMUs of FMI 3.0 and is ignored for all others.
    publish_to : path, optional
        Folder into which `publish` writes each FMU that runs here.

    Yields
    ------
    BuiltFmu

    Raises
    ------
    UnknownNameError
        If there is no such model, kind or platform; raised before anything is built.
    BuildError
        If an FMU cannot be built, is not valid or does not run.
    MissingLibraryError
        If Zig is not installed, or wasmtime, which `WASM` needs.
    """
    known = {mechanism.fmu: mechanism for mechanism in MECHANISMS.values()}
    for what, names, there in (
        ("model", models, known),
        ("kind of FMU", kinds, KINDS),
        ("platform", platforms, (ALL, *EVERYWHERE)),
    ):
        for name in names:
            if name not in there:
                raise unknown_name(name, there, f"{what} {name!r}")
    models, kinds, platforms = ([*dict.fromkeys(names)] for names in (models, kinds, platforms))
    chosen = [KINDS[name] for name in kinds or KINDS]
    here = this_platform() if any(kind is not PYTHON for kind in chosen) else ""
    every = [*PLATFORMS, *(name for name in platforms if name == WASM)]
    asked = tuple(every) if ALL in platforms else tuple(platforms) or (here,)
    for name in models or known:
        for kind in chosen:
            python = kind is PYTHON
            native = asked if kind.fmi == 3 else tuple(name for name in asked if name != WASM)
            if not (native or python or kinds):
                continue
            native = native or asked
            made = build(known[name], dest) if python else build_native(known[name], kind, dest, native)
            if python or here in native:
                run_trial(made)
                if publish_to is not None:
                    publish(known[name], kind, made, publish_to)
            yield BuiltFmu(made, () if python else native)
