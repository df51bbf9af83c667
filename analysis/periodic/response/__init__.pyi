from .advice import ranges_to_avoid as ranges_to_avoid
from .branch import Branch as Branch
from .branch import follow as follow
from .branch import switch as switch
from .frequency import Response as Response
from .frequency import frequency_response as frequency_response
from .frequency import natural_frequency as natural_frequency
