from .burmester import Guidance as Guidance
from .burmester import GuidanceMap as GuidanceMap
from .burmester import guidance as guidance
from .generation import Generators as Generators
from .generation import QuickReturn as QuickReturn
from .generation import QuickSwing as QuickSwing
from .generation import cognates as cognates
from .generation import function_generators as function_generators
