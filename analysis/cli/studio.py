"""`linkwork studio`: the page on which a mechanism moves, can be dragged, and tells the truth."""

from __future__ import annotations

import tempfile
import webbrowser
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from ..mechanisms import PUBLISHED
from .common import PARAMETERS, RUN, changes, check_kind, force_option, handled, number_or_text, say, set_option


@click.command()
@click.argument("what", required=False)
@click.option("--out", type=click.Path(dir_okay=False), help="Write the page here, and open no browser.")
@set_option("slider.stiffness='2e6 dyn/cm' or drive.speed='300 rpm'; bare numbers are in SI")
@force_option
@handled
def studio(what: str | None, out: str | None, settings: Sequence[str]) -> None:
    """Open the page on which a mechanism moves and can be dragged.

    WHAT is a case file, a file of parameters such as linkwork synthesize writes, or the name of a published set; without it the
    page opens with a five-bar. The page is one file that needs no network and no Python.

    \b
    Examples:
      linkwork studio
      linkwork studio table-3.1
      linkwork studio examples/slider-crank.toml --set drive.speed='80 rpm' --out page.html
    """
    from ..files import write_text
    from ..studio import page_of

    page = page_of(_state(what, changes(settings, number_or_text, "slider.stiffness='2e6 dyn/cm'")))
    if out is not None:
        say(f"wrote {write_text(out, page)}")
        return
    path = Path(tempfile.mkdtemp(prefix="linkwork-studio-")) / "studio.html"
    path.write_text(page, encoding="utf-8")
    say(f"opening {path}")
    if not webbrowser.open(path.as_uri()):
        say("there is no browser here: open the file in one, or write it elsewhere with --out")


def _state(what: str | None, overrides: dict[str, Any]) -> dict[str, Any]:
    from ..files import read_tables
    from ..run import case_from, load_case
    from ..studio import opening_state, state_of

    if what is None:
        if overrides:
            raise click.UsageError("--set changes a case or a published set: name one")
        return opening_state()
    if what in PUBLISHED:
        return state_of(case_from({"published": what}, folder=Path.cwd(), title=what, overrides=overrides))
    if not Path(what).is_file():
        raise click.UsageError(f"{what!r} is no file, and no published set: {', '.join(PUBLISHED)}")
    check_kind(what, RUN, PARAMETERS)
    tables = read_tables(what)
    if "run" not in tables and not any(name.startswith("run.") for name in overrides):
        # of parameters alone: how long they are run is no part of them
        overrides = {"run.stop_time": 1.0} | overrides
    return state_of(load_case(what, overrides))
