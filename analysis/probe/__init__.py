"""Probe an FMU of any make: does it follow the FMI standard, and what does it do if the importer makes mistakes?

The FMU runs in separate processes, so that a crash of the FMU is a finding and not the end of the probe.
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
