from .burmester import Guidance as Guidance
from .burmester import GuidanceMap as GuidanceMap
from .burmester import guidance as guidance
from .four_bar import Generators as Generators
from .four_bar import cognates as cognates
from .four_bar import function_generators as function_generators
from .quick_return import QuickReturn as QuickReturn
from .quick_return import QuickSwing as QuickSwing
