"""Compile all kernels for any processor of this architecture, into the folder of the package from which it loads them.

Run it as ``python packaging/kernels.py``; see `analysis.numerics.linking`.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from joblib import Parallel, delayed

from analysis.numerics.codegen import CARRIED, Kernel

#: Modules that define kernels.
MODULES = (
    "analysis.numerics.overlap",
    "analysis.periodic.chart.kernels",
    "analysis.periodic.motion.collocation",
    "analysis.periodic.motion.kernels",
    "analysis.run.compiled",
    "analysis.run.lanes",
    "analysis.run.sources",
    "analysis.slider_crank.kernels",
    "analysis.synthesis.linkage.kernels",
)


def kernels() -> list[Kernel]:
    """Return all kernels, in the same order in each process."""
    for name in MODULES:
        import_module(name)
    return Kernel.known


def carry(number: int) -> Path:
    """Compile the kernel of this index in `kernels`; return the path of its file."""
    return kernels()[number].carry()


def main() -> None:
    """Compile the kernels that are missing, on all cores, and remove files of kernels that no longer exist."""
    wanted = [kernel.carried_path for kernel in kernels()]
    for path in CARRIED.glob("*"):
        if path not in wanted:
            path.unlink()
    missing = [number for number, path in enumerate(wanted) if not path.is_file()]
    Parallel(n_jobs=-1)(delayed(carry)(number) for number in missing)


if __name__ == "__main__":
    main()
