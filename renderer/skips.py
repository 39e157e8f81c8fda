"""Work that the renderer leaves out because the image is the same without it.

All that changes nothing is left out by default. Switching a skip off measures what it saves: the
image stays the same bit for bit, because what is then added is exactly zero.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Skips:
    """What is left out.

    facing_away : lights and samples behind the surface, before a ray exists
    zero : lights and samples that carry nothing, since the map is black there or the surface does
        not reflect
    empty_layer : rendering and upsampling of a low-frequency layer without lights
    lambert_brdf : BRDF sampling where all that the view shows is ideally diffuse; all samples then
        go to the light. Off by default: the mean is the same, the noise is not.
    """

    facing_away: bool = True
    zero: bool = True
    empty_layer: bool = True
    lambert_brdf: bool = False


DEFAULT = Skips()
