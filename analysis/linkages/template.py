"""Text of the file that `linkwork new linkage` writes: a four-bar linkage with every table explained."""

from __future__ import annotations

from pathlib import Path

#: The text, in which ``{file}`` stands for the name of the file.
TEXT = Path(__file__).with_suffix(".toml").read_text(encoding="utf-8")
