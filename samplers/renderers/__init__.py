"""The tables by which today's renderers draw from a map, as distributions of this project.

Each module is one renderer's: what it tabulates, how it draws, and whether it compensates for BRDF
sampling. Their code is not used, their rules are. The light itself is this project's map, constant
over each pixel, so a table that filters the map or spreads it over other cells pays for that here;
the estimate stays unbiased beside BRDF sampling, which covers what a table misses.

What they share: `lat_long.py` and `square.py` turn a table into a distribution; `compensation.py`
takes a constant off. Every distribution tells `nbytes`, what its tables take, and `map_reads`, how
many texels of the map building them reads.
"""

from samplers.renderers.cycles import Cycles
from samplers.renderers.falcor import Falcor
from samplers.renderers.luxcore import LuxCore
from samplers.renderers.mitsuba_3 import Mitsuba3
from samplers.renderers.pbrt_v4 import PbrtV4

__all__ = ["Cycles", "Falcor", "LuxCore", "Mitsuba3", "PbrtV4"]
