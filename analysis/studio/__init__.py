"""The studio: a page on which mechanisms move and can be dragged, with the FMU's equations compiled to WebAssembly."""

from .page import PAGE, address_of, build_page, fresh, page_of
from .state import OPENING, case_of, given_values, opening_state, state_of
from .tables import shown_in

__all__ = [
    "OPENING",
    "PAGE",
    "address_of",
    "build_page",
    "case_of",
    "fresh",
    "given_values",
    "opening_state",
    "page_of",
    "shown_in",
    "state_of",
]
