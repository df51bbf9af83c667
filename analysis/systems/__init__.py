"""Systems of connected FMUs: description, SSP files, a co-simulation master, and the errors of its couplings."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
