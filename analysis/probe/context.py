"""Define the context of a check: all that it uses in the process that runs it."""

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

#: Exit codes of the process of a check: an instance returned Fatal, so that the process cannot go on; the probe itself failed.
AFTER_FATAL, FAILED = 3, 70


@dataclass(slots=True, kw_only=True)
class Context:
    """The FMU, the journal of calls and the file of findings of one check.

    Parameters
    ----------
    model : Model
    library : Library
    folder : pathlib.Path
        The extracted FMU.
    work : pathlib.Path
        A folder for the files of the probe.
    journal : Journal
    findings : pathlib.Path
        File to which findings are appended, one line of JSON each.
    seed : int
        Seed of the random numbers.
    check : str
        Name of the check.
    avoided : frozenset of str
        Faults that have crashed the process and are not tried again.
    """

    model: Model
    library: Library
    folder: Path
    work: Path
    journal: Journal
    findings: Path
    seed: int
    check: str
    avoided: frozenset[str] = frozenset()
    _shown: dict[tuple[str, str], int] = field(default_factory=dict)

    def session(self) -> Session:
        """Open a session without an instance."""
        return Session(self.library, self.model, self.journal, self.folder)

    def random(self, case: int, check: str = "") -> random.Random:
        """Return the generator of random numbers for a case of a check, by default this check; it is the same each time."""
        return random.Random(f"{self.seed}/{self.model.interface}/{check or self.check}/{case}")

    def replay(self) -> str:
        """Return the name of the current case, for --replay."""
        return f"{self.seed}/{self.model.interface}/{self.check}/{self.journal.case}"

    def note(self, severity: str, key: str, text: str) -> None:
        """Write a finding; its list of calls is left out if an equal finding with as few calls was written before."""
        lines = self.journal.lines()
        best = self._shown.get((severity, key), 1 << 30)
        self._shown[severity, key] = min(best, len(lines))
        finding = {"severity": severity, "key": key, "text": text, "calls": lines if len(lines) < best else None}
        self._write(finding | {"replay": self.replay()})

    def tell(self, subject: str) -> None:
        """Write what the current case is about, so that a crash can be attributed to it."""
        self._write({"subject": subject, "case": self.journal.case})

    def say(self, sentence: str) -> None:
        """Add a sentence to the result of the check: a measured value, or the reason why there is none."""
        self._write({"said": sentence})

    def finish(self) -> None:
        """Write that the process has come to its regular end."""
        self._write({"finished": True})

    def _write(self, record: dict[str, Any]) -> None:
        with self.findings.open("a", encoding="utf-8") as file:
            file.write(json.dumps(record) + "\n")


#: A function that runs one case of a check, given its number.
Case = Callable[[Context, int], None]
