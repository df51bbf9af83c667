"""Run the ``linkwork`` command as ``python -m analysis.cli``."""

from . import main

main()
