"""Evaluate solutions: errors and defects of a linkage in its task, cost of dimensional errors, reports and drawings."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
