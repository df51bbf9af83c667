"""Youssef's theory of the five-bar slider: linear equation, harmonic balance, Hill's regions, accessible area."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
