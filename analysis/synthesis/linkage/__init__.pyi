from .kind import Kind as Kind
from .linkage import Linkage as Linkage
from .machine import Make as Make
from .machine import PinForces as PinForces
from .machine import pin_forces as pin_forces
from .pivot import SecondCrank as SecondCrank
from .pivot import SliderMotion as SliderMotion
