"""Define the context of a check: everything that the check uses in the process that runs it."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .journal import Journal
from .model import Model
from .session import Library, Session

#: Exit codes of the process of a check: an instance returned Fatal and the process must end; the probe itself failed.
AFTER_FATAL, FAILED = 3, 70


@dataclass(slots=True, kw_only=True)
class Context:
    """The context of a check: the FMU, the journal of calls, and the file of findings."""

    model: Model
    library: Library
    folder: Path  # the extracted FMU
    work: Path  # for the files of the probe
    journal: Journal
    findings: Path  # findings are appended to this file, one line of JSON each
    seed: int  # of the random numbers
    check: str  # name of the check
    # keys of forbidden calls that crashed an earlier process; they are not tried again
    avoided: frozenset[str] = frozenset()
    faults: list[Any] = field(default_factory=list)  # what the forbidden calls try, once it is listed
    _shown: dict[tuple[str, str], int] = field(default_factory=dict)

    def session(self) -> Session:
        """Return a session with the FMU, in which no instance is made yet."""
        return Session(self.library, self.model, self.journal, self.folder)

    def random(self, case: int, check: str = "") -> random.Random:
        """Return the random number generator of a case of a check, by default this check; every run gives the same numbers."""
        return random.Random(f"{self.seed}/{self.model.interface}/{check or self.check}/{case}")

    def replay(self) -> str:
        """Return the name of the current case for the option --replay, such as "7/cs/forbidden/12"."""
        return f"{self.seed}/{self.model.interface}/{self.check}/{self.journal.case}"

    def note(self, severity: str, key: str, text: str) -> None:
        """Write a finding; leave out its calls if the same finding was already written with as few calls or fewer."""
        lines = self.journal.lines()
        best = self._shown.get((severity, key), 1 << 30)
        self._shown[severity, key] = min(best, len(lines))
        finding = {"severity": severity, "key": key, "text": text, "calls": lines if len(lines) < best else None}
        self._write(finding | {"replay": self.replay()})

    def tell(self, subject: str) -> None:
        """Write the subject of the current case, such as a forbidden call, so that a crash can be attributed to the subject."""
        self._write({"subject": subject, "case": self.journal.case})

    def say(self, sentence: str) -> None:
        """Add a sentence to the result of the check: a measured value, or the reason why the check was not made."""
        self._write({"said": sentence})

    def finish(self) -> None:
        """Write that the process ends regularly, after all its cases."""
        self._write({"finished": True})

    def _write(self, record: dict[str, Any]) -> None:
        with self.findings.open("a", encoding="utf-8") as file:
            file.write(json.dumps(record) + "\n")


#: A function that runs one case of a check, given its number.
Case = Callable[[Context, int], None]
