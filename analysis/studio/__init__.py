"""The studio: a page on which mechanisms move, can be dragged, and tell the truth, by the same equations as WebAssembly."""

from .page import PAGE, build_page, fresh, page_of
from .state import OPENING, opening_state, state_of

__all__ = ["OPENING", "PAGE", "build_page", "fresh", "opening_state", "page_of", "state_of"]
