"""Build and validate the FMUs of Linkwork: ``python build_fmu.py [--dest build] [--platforms all] [FiveBarSlider ...]``.

Of each mechanism the Python FMU and the native ones. The exit code is 0 only if every FMU was built, found valid, and run.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from analysis.export import KINDS, PLATFORMS, PYTHON, build, build_native, publish, this_platform, try_out
from analysis.mechanisms import MECHANISMS
from linkwork.errors import InputError, LinkworkError

FMUS = {mechanism.fmu: mechanism for mechanism in MECHANISMS.values()}


def main(arguments: Sequence[str] | None = None) -> int:
    """Build the FMUs named on the command line, or all of them."""
    parser = argparse.ArgumentParser(description="Build and validate the FMUs of Linkwork.")
    parser.add_argument("models", nargs="*", metavar="MODEL", help=f"which to build: {', '.join(FMUS)}; all by default")
    parser.add_argument("--dest", default="build", help="folder for the FMUs (default: %(default)s)")
    parser.add_argument(
        "--kinds", nargs="+", choices=KINDS, default=list(KINDS), metavar="KIND",
        help=f"kinds of FMU: {', '.join(KINDS)}; all by default",
    )  # fmt: skip
    parser.add_argument(
        "--platforms", nargs="+", choices=["all", *PLATFORMS], metavar="PLATFORM",
        help=f"for which platforms native FMUs are compiled: all, or some of {', '.join(PLATFORMS)}; by default for this one",
    )  # fmt: skip
    parser.add_argument(
        "--publish",
        metavar="FOLDER",
        help="write each FMU there too, with inputs, reference results and who imports it",
    )
    options = parser.parse_args(arguments)
    try:
        here = this_platform() if any(KINDS[kind] is not PYTHON for kind in options.kinds) else ""
        platforms = list(PLATFORMS) if "all" in (options.platforms or ()) else options.platforms or [here]
        for name in options.models or list(FMUS):
            if name not in FMUS:
                raise InputError(f"there is no model {name!r}: the models are {', '.join(FMUS)}")
            for kind in (KINDS[k] for k in options.kinds):
                python = kind is PYTHON
                fmu = (
                    build(FMUS[name], options.dest)
                    if python
                    else build_native(FMUS[name], kind, options.dest, platforms)
                )
                if python or here in platforms:
                    try_out(fmu)
                    if options.publish:
                        publish(FMUS[name], kind, fmu, options.publish)
                made = "" if python else f", {' '.join(platforms)}"
                print(f"{fmu}: valid, {fmu.stat().st_size / 1024:.0f} KiB{made}")
    except LinkworkError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
