"""The page of the studio as a widget in a notebook, whose state Python can read and set."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..libraries import MissingLibraryError
from ..run import Case, published_case
from .page import make_page
from .state import opening_state, page_case, page_state

try:
    import anywidget
    import traitlets
except ImportError as error:
    raise MissingLibraryError("anywidget") from error


class Widget(anywidget.AnyWidget):
    """The studio in a notebook: dragging changes ``state``, and a change of ``state`` in Python moves the mechanism.

    Parameters
    ----------
    what : Case or str, optional
        A case, or the name of a published set; a five-bar by default.
    height : int
        Height of the page in the notebook (pixels).

    Attributes
    ----------
    state : dict
        State of the page: mechanism, title, and values in SI by the names of the FMU's variables.

    Raises
    ------
    InputError
        If the published set does not exist, or the case has inputs that the page does not support.
    """

    _esm = Path(__file__).with_name("widget.js")
    page = traitlets.Unicode().tag(sync=True)
    state = traitlets.Dict().tag(sync=True)
    height = traitlets.Int(900).tag(sync=True)

    def __init__(self, what: Case | str | None = None, *, height: int = 900) -> None:
        if isinstance(what, str):
            what = published_case(what)
        state = opening_state() if what is None else page_state(what)
        super().__init__(state=state, page=make_page(state), height=height)

    @traitlets.validate("state")
    def _check(self, proposal: Mapping[str, Any]) -> Any:
        page_case(proposal["value"])
        return proposal["value"]

    @property
    def case(self) -> Case:
        """Return the case that the page shows: parameters, initial state and inputs."""
        return page_case(self.state)

    def change(self, values: Mapping[str, float]) -> None:
        """Change values, given in SI by the names of the FMU's variables.

        Raises
        ------
        LinkworkError
            If the mechanism has no variable of that name, or does not allow the value.
        """
        self.state = dict(self.state) | {"values": dict(self.state["values"]) | dict(values)}
