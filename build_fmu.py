"""Build and validate Linkwork's FMUs from a checkout: ``python build_fmu.py`` does the same as ``linkwork build``.

The exit code is 0 only if every FMU was built, is valid, and runs.
"""

from __future__ import annotations

import sys

from analysis.cli import main
from analysis.mechanisms import MECHANISMS

FMUS = {mechanism.fmu: mechanism for mechanism in MECHANISMS.values()}

if __name__ == "__main__":
    main(["build", *sys.argv[1:]])
