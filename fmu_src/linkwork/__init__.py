"""Linkwork's plants: the mechanisms' equations and their integrator, in plain Python.

Only the standard library is used here, because this package travels inside the FMUs. If the package `analysis` is installed
too, the public names of `analysis` are also available here: ``linkwork.simulate`` is ``analysis.simulate``, imported at its
first use. If both packages have a module of the same name, the module of this package is returned:
``linkwork.slider_crank`` is the plant.
"""

from __future__ import annotations

from typing import Any

__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    """Return a public name of the package `analysis`.

    Raises
    ------
    AttributeError
        If `analysis` has no such name or, as inside an FMU, is not available.
    ImportError
        If another module named ``analysis`` is imported instead of Linkwork's.
    """
    from importlib import import_module, util
    from pathlib import Path

    missing = AttributeError(f"module {__name__!r} has no attribute {name!r}", name=name)
    # inside an FMU this package has the hash of its content in its name
    if __name__ != "linkwork" or name.startswith("_") or util.find_spec(f"{__name__}.{name}") is not None:
        raise missing
    try:
        analysis = import_module("analysis")
    except ModuleNotFoundError:
        raise missing from None
    path = str(analysis.__file__)
    if not Path(path).with_name("mechanisms.py").is_file():
        raise ImportError(
            f"linkwork.{name} is in the package analysis, but {path} is imported in its place: give it another name",
            name="analysis",
            path=path,
        )
    return getattr(analysis, name)
