"""Compile all kernels for any processor of this kind into the package, from where an installation takes them: see `linking`.

Run it as ``python packaging/kernels.py``.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from joblib import Parallel, delayed

from analysis.numerics.codegen import CARRIED, Kernel

#: Modules that have kernels.
MODULES = (
    "analysis.numerics.overlap",
    "analysis.periodic.chart.kernels",
    "analysis.periodic.motion.collocation",
    "analysis.periodic.motion.kernels",
    "analysis.run.compiled",
    "analysis.run.lanes",
    "analysis.run.sources",
    "analysis.synthesis.linkage.kernels",
)


def kernels() -> list[Kernel]:
    """Return all kernels, in the same order in each process."""
    for name in MODULES:
        import_module(name)
    return Kernel.known


def carry(number: int) -> Path:
    """Compile one of the kernels; return its path."""
    return kernels()[number].carry()


def main() -> None:
    """Compile those that are missing, on all cores, and remove the others."""
    wanted = [kernel.carried_path for kernel in kernels()]
    for path in CARRIED.glob("*"):
        if path not in wanted:
            path.unlink()
    missing = [number for number, path in enumerate(wanted) if not path.is_file()]
    Parallel(n_jobs=-1)(delayed(carry)(number) for number in missing)


if __name__ == "__main__":
    main()
