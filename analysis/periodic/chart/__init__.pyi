from .boundary import follow_crossing as follow_crossing
from .boundary import removing_damping as removing_damping
from .chart import StabilityChart as StabilityChart
from .chart import stability_chart as stability_chart
from .coexistence import Basins as Basins
from .coexistence import Coexistence as Coexistence
from .coexistence import basins as basins
from .grid import Grid as Grid
