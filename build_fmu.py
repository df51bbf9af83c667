"""Build and validate the FMUs of Linkwork: ``python build_fmu.py [--dest build] [FiveBarSlider ...]``.

The exit code is 0 only if every FMU was built, found valid, and run.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from analysis.export import build, try_out
from analysis.mechanisms import MECHANISMS
from linkwork.errors import InputError, LinkworkError

FMUS = {mechanism.fmu: mechanism for mechanism in MECHANISMS.values()}


def main(arguments: Sequence[str] | None = None) -> int:
    """Build the FMUs named on the command line, or all of them."""
    parser = argparse.ArgumentParser(description="Build and validate the FMUs of Linkwork.")
    parser.add_argument("models", nargs="*", metavar="MODEL", help=f"which to build: {', '.join(FMUS)}; all by default")
    parser.add_argument("--dest", default="build", help="folder for the FMUs (default: %(default)s)")
    options = parser.parse_args(arguments)
    for name in options.models or list(FMUS):
        try:
            if name not in FMUS:
                raise InputError(f"there is no model {name!r}: the models are {', '.join(FMUS)}")
            fmu = build(FMUS[name], options.dest)
            try_out(fmu)
        except LinkworkError as error:
            print(f"error: {error}", file=sys.stderr)
            return 1
        print(f"{fmu}: valid, {fmu.stat().st_size / 1024:.0f} KiB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
