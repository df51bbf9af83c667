"""Define findings with their severities, and the report of a probe."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

CRASH, WRONG, QUESTIONABLE = "crash", "wrong", "questionable"
SEVERITIES = (CRASH, WRONG, QUESTIONABLE)


#: A function that takes a finding: its severity, a key (subject and kind of the finding), and a sentence.
Note = Callable[[str, str, str], None]


@dataclass(slots=True, kw_only=True)
class Finding:
    """One fault of an FMU, with the calls that show the fault.

    Parameters
    ----------
    severity : str
        One of `SEVERITIES`.
    key : str
        Interface, subject and kind of the finding; findings with the same key and severity are counted as one.
    text : str
        The finding as a sentence.
    calls : list of str
        The calls of the shortest case that shows the fault.
    replay : str
        Name of this case, for the option `--replay`.
    count : int
        Number of cases that show the fault.
    """

    severity: str  # one of `SEVERITIES`
    key: str  # interface, subject and kind of the finding
    text: str  # the finding as a sentence
    calls: list[str]  # of the shortest case that shows the fault
    replay: str  # name of this case, for the option `--replay`
    count: int = 1  # number of cases that show the fault

    @property
    def subject(self) -> str:
        """Return the function, variable or folder that the finding is about: the part of the key after the interface."""
        return self.key.split(": ")[1] if self.key.count(": ") > 1 else ""

    @property
    def kind(self) -> str:
        """Return the kind of the finding: the part of the key after the subject."""
        return ": ".join(self.key.split(": ")[2:]) or self.text


@dataclass(slots=True, kw_only=True)
class Outcome:
    """The result of one check on one interface."""

    check: str
    interface: str
    cases: int  # number of cases that were run
    calls: int  # number of calls that were made
    seconds: float
    said: str = ""  # measured values, or the reason why the check was not made


@dataclass(slots=True, kw_only=True)
class Report:
    """The report of a probe."""

    fmu: str
    fmi_version: str
    seed: int
    findings: list[Finding] = field(default_factory=list)
    outcomes: list[Outcome] = field(default_factory=list)

    @property
    def calls(self) -> int:
        return sum(outcome.calls for outcome in self.outcomes)

    def with_severity(self, *severities: str) -> list[Finding]:
        """Return the findings of these severities."""
        return [finding for finding in self.findings if finding.severity in severities]

    def add(self, finding: Finding) -> None:
        """Add a finding; if a finding with the same severity and key is known, count both as one and keep the shorter calls."""
        for known in self.findings:
            if (known.severity, known.key) == (finding.severity, finding.key):
                known.count += finding.count
                if len(finding.calls) < len(known.calls):
                    known.calls, known.replay, known.text = finding.calls, finding.replay, finding.text
                return
        self.findings.append(finding)
        self.findings.sort(key=lambda f: SEVERITIES.index(f.severity))

    def to_dict(self) -> dict[str, Any]:
        """Return the report as plain data, for JSON."""
        return asdict(self)

    def to_markdown(self) -> str:
        """Return the report as Markdown."""
        counts = ", ".join(f"{len(self.with_severity(severity))} {severity}" for severity in SEVERITIES)
        lines = [
            f"# Probe of {self.fmu}",
            "",
            f"FMI {self.fmi_version}, seed {self.seed}, {self.calls} calls. Findings: {counts}.",
            "",
            "| check | interface | cases | calls | s | result |",
            "| --- | --- | --- | --- | --- | --- |",
            *(
                f"| {o.check} | {o.interface} | {o.cases} | {o.calls} | {o.seconds:.1f} | {o.said} |"
                for o in self.outcomes
            ),
        ]
        for number, finding in enumerate(self.findings, 1):
            seen = f", in {finding.count} cases" if finding.count > 1 else ""
            replay = f"`--replay {finding.replay}`" if finding.replay else ""
            lines += ["", f"## {number}. {finding.severity}: {finding.text}", "", f"{replay}{seen}", "", "```"]
            lines += [*last_calls(finding.calls, 30), "```"]
        return "\n".join(lines) + "\n"


def last_calls(calls: Sequence[str], most: int) -> list[str]:
    """Return the last ``most`` calls of a list; if there are more, a first line says how many are left out."""
    return list(calls) if len(calls) <= most else [f"... {len(calls) - most} calls", *calls[-most:]]
