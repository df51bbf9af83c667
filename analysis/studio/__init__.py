"""The studio: a page on which mechanisms move and can be dragged, with the FMU's equations compiled to WebAssembly."""

from .page import PAGE, build_page, fresh, make_page, page_address
from .state import OPENING, given_values, opening_state, page_case, page_state
from .tables import shown_unit

__all__ = [
    "OPENING",
    "PAGE",
    "build_page",
    "fresh",
    "given_values",
    "make_page",
    "opening_state",
    "page_address",
    "page_case",
    "page_state",
    "shown_unit",
]
