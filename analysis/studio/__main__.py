"""Build the page with `python -m analysis.studio`, from the template that `npm run build` in `studio/` has written."""

from .page import main

main()
