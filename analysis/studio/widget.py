"""The page of the studio as a widget of a notebook, whose state Python reads and sets."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..files import unknown_name
from ..libraries import MissingLibraryError
from ..mechanisms import PUBLISHED
from ..run import Case, case_from
from .page import page_of
from .state import case_of, opening_state, state_of

try:
    import anywidget
    import traitlets
except ImportError as error:
    raise MissingLibraryError("anywidget") from error


class Widget(anywidget.AnyWidget):
    """The studio in a notebook: what is dragged there is known here, and what is changed here moves there.

    Parameters
    ----------
    what : Case or str, optional
        A case, or the name of a published set; a five-bar by default.
    height : int
        Of the page in the notebook (pixels).

    Attributes
    ----------
    state : dict
        What the page shows: mechanism, title, and values by the names of the FMU's variables, in SI.

    Raises
    ------
    InputError
        If there is no such set, or a case has inputs that the page has not.
    """

    _esm = Path(__file__).with_name("widget.js")
    page = traitlets.Unicode().tag(sync=True)
    state = traitlets.Dict().tag(sync=True)
    height = traitlets.Int(900).tag(sync=True)

    def __init__(self, what: Case | str | None = None, *, height: int = 900) -> None:
        if isinstance(what, str):
            if what not in PUBLISHED:
                raise unknown_name(what, PUBLISHED, f"published set {what!r}")
            what = case_from({"published": what}, folder=Path(), title=what)
        state = opening_state() if what is None else state_of(what)
        super().__init__(state=state, page=page_of(state), height=height)

    @traitlets.validate("state")
    def _check(self, proposal: Mapping[str, Any]) -> Any:
        case_of(proposal["value"])
        return proposal["value"]

    @property
    def case(self) -> Case:
        """Return the case that the page shows: parameters, initial state and inputs."""
        return case_of(self.state)

    def change(self, values: Mapping[str, float]) -> None:
        """Change values, in SI by the names of the FMU's variables.

        Raises
        ------
        LinkworkError
            If the mechanism has no such value, or cannot have it.
        """
        self.state = dict(self.state) | {"values": dict(self.state["values"]) | dict(values)}
