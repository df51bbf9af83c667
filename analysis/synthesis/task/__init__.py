"""Define the problem of a synthesis: targets and tasks, constraints and bounds, and their normal form.

The public names are listed in ``__init__.pyi``; each is imported from its module when it is first used.
"""

from __future__ import annotations

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
