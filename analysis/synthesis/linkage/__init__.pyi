from .kind import Kind as Kind
from .linkage import Linkage as Linkage
from .linkage import SecondCrank as SecondCrank
from .linkage import SliderMotion as SliderMotion
from .machine import Make as Make
from .machine import PinForces as PinForces
from .machine import pin_forces as pin_forces
