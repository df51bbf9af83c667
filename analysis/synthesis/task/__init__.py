"""Define the problem of a synthesis: targets and tasks, constraints and bounds, and their normal form."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
