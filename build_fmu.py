"""``python build_fmu.py`` is ``linkwork build`` from a checkout: it builds and validates the FMUs of Linkwork.

The exit code is 0 only if every FMU was built, found valid, and run.
"""

from __future__ import annotations

import sys

from analysis.cli import main
from analysis.mechanisms import MECHANISMS

FMUS = {mechanism.fmu: mechanism for mechanism in MECHANISMS.values()}

if __name__ == "__main__":
    main(["build", *sys.argv[1:]])
