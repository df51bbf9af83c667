from .nonlinear import Confirmation as Confirmation
from .nonlinear import NormalForm as NormalForm
from .nonlinear import SpecialPoint as SpecialPoint
from .nonlinear import confirm as confirm
from .nonlinear import normal_form as normal_form
from .sensitivity import MotionGradient as MotionGradient
from .sensitivity import motion_gradient as motion_gradient
