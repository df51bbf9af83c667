"""Build the page with `python -m analysis.studio`, from the template that `npm run build` in `studio/` has written."""

from ..files import write_text
from .page import PAGE, build_page

write_text(PAGE, build_page())
