"""Probing an FMU of any make: does it do what the standard says, and what does it do when the importer errs?

The FMU runs in processes of its own, so that its crash is a finding and not the end of the probe.
"""

from .findings import CRASH, QUESTIONABLE, SEVERITIES, WRONG, Finding, Outcome, Report, last_calls
from .runner import probe, replay
from .session import ProbeError

__all__ = [
    "CRASH",
    "QUESTIONABLE",
    "SEVERITIES",
    "WRONG",
    "Finding",
    "Outcome",
    "ProbeError",
    "Report",
    "last_calls",
    "probe",
    "replay",
]
