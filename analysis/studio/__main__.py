"""`python -m analysis.studio` builds the page anew, from what `npm run build` in `studio/` has made."""

from .page import main

main()
