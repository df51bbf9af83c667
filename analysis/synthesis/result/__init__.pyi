from .drawing import LinkageScene as LinkageScene
from .drawing import plates as plates
from .report import dimension_rows as dimension_rows
from .report import sensitivities as sensitivities
from .solution import Solution as Solution
from .solution import Verdicts as Verdicts
from .solution import evaluate as evaluate
from .solution import judge as judge
