from .case import SynthesisCase as SynthesisCase
from .case import load_synthesis_case as load_synthesis_case
from .tables import KINDS as KINDS
