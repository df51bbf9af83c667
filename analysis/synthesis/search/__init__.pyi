from .polish import Search as Search
from .program import Program as Program
from .solve import Synthesis as Synthesis
from .solve import synthesize as synthesize
from .solve import trade_off as trade_off
