"""`linkwork studio`: open the web page on which a mechanism moves and can be dragged."""

from __future__ import annotations

import os
import signal
import sys
import threading
import webbrowser
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from ..mechanisms import PUBLISHED
from . import common

#: Environment variables; one of them is set if there is a screen or if the user has chosen a browser.
_SCREENS = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")


@click.command()
@click.argument("what", required=False)
@click.option(
    "--out",
    type=click.Path(dir_okay=False),
    callback=common.check_place,
    help="Write the page to this file, and serve nothing.",
)
@click.option("--browser/--no-browser", default=True, help="Whether to open a browser.")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    show_default=False,
    help="Port on which the page is served; by default a free one.",
)
@common.set_option("slider.stiffness='2e6 dyn/cm' or drive.speed='300 rpm'; bare numbers are in SI")
@common.force_option
@common.report_errors
def studio(what: str | None, out: str | None, browser: bool, port: int, settings: Sequence[str]) -> None:
    """Open the web page on which a mechanism moves and can be dragged.

    WHAT is a case file, a file of parameters such as linkwork synthesize writes, or the name of a published set; without WHAT
    the page opens with a five-bar. The page is served only to this machine, until Ctrl-C. With --out the page is written to a
    file instead, which needs neither network nor Python. The file can do everything except what Python does for the served
    page: find linkages for a drawn path, find slider motions, tune, run the FMU and export the FMU.

    \b
    Examples:
      linkwork studio
      linkwork studio table-3.1
      linkwork studio examples/run-up.toml --set force='0 N' --out page.html
    """
    from ..files import write_text
    from ..studio import make_page

    page = make_page(_state(what, common.changes(settings, "slider.stiffness='2e6 dyn/cm'")))
    if out is not None:
        common.say(f"wrote {write_text(out, page)}")
        return
    from ..server import Server

    server = Server(page, port)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    server.worker.start()
    common.say(f"the studio is at {server.address}")
    common.print_error("it is served to this machine alone; Ctrl-C stops it")
    if browser:
        # a browser in a terminal returns only when the user closes it, and the page must be served until then
        threading.Thread(target=_open, args=(server.address,), daemon=True).start()
    server.run()
    common.print_error("the studio is closed")


def _open(address: str) -> None:
    """Open a browser at an address; print a note if there is no screen or no browser opens.

    A browser in a terminal is not opened because it cannot show the page.
    """
    screen = sys.platform in ("win32", "darwin") or any(os.environ.get(name) for name in _SCREENS)
    if not (screen and webbrowser.open(address)):
        common.note("there is no browser here: open the address in one, or write the page as a file with --out")


def _state(what: str | None, overrides: dict[str, Any]) -> dict[str, Any]:
    from ..files import read_tables, unknown_name
    from ..run import load_case, published_case, read_case
    from ..studio import opening_state, page_state

    if what is None:
        if overrides:
            raise click.UsageError("--set changes a case or a published set: name one")
        return opening_state()
    if what in PUBLISHED and not overrides:
        return page_state(published_case(what))
    if what in PUBLISHED:
        # a case file with a published set may begin at rest: give its own start
        tables = {"published": what, "initial": asdict(PUBLISHED[what].initial)}
        return page_state(read_case(tables, folder=Path.cwd(), title=what, overrides=overrides))
    if not Path(what).is_file():
        raise unknown_name(what, PUBLISHED, f"file or published set {what!r}")
    common.check_kind(what, common.RUN, common.PARAMETERS)
    tables = read_tables(what)
    if "run" not in tables and not any(name.startswith("run.") for name in overrides):
        # a file of parameters does not say how long a run is
        overrides = {"run.stop_time": 1.0} | overrides
    return page_state(load_case(what, overrides))
