"""Plan the motion of the five-bar's slider for a task of the linkage, and compute the drive that the motion needs.

`variational_motion` finds the best position at every crank angle, `slider_motion` the best Fourier series, and
`simplest_mechanism` the simplest mechanism that is good enough. `inverse_dynamics` and `best_spring` compute the force of a
motion; `track` runs the full plant under control.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
