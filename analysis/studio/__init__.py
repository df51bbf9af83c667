"""The studio: a page on which mechanisms move and can be dragged, with the FMU's equations compiled to WebAssembly."""

from .page import PAGE, build_page, is_current, make_page, page_address
from .state import OPENING, given_values, opening_state, page_case, page_state
from .tables import shown_unit

__all__ = [
    "OPENING",
    "PAGE",
    "build_page",
    "given_values",
    "is_current",
    "make_page",
    "opening_state",
    "page_address",
    "page_case",
    "page_state",
    "shown_unit",
]
