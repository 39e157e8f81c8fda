"""Lambert's surface: f_r = albedo/π, sampled in proportion to the cosine. One lane at a time.

evaluate = albedo / π
pdf      = n·l / π
sample   = (x, y, √(1 − x² − y²)) of a point that is uniform on the unit disc
"""

import math

from renderer.packet.layout import LANE_INV_PI, ONE, ZERO
from renderer.packet.material_table import INV_PI
from samplers.compiled import inner


@inner
def evaluate(albedo):
    """f_r in sr⁻¹."""
    return albedo * INV_PI


@inner
def pdf(share, nl):
    """`share` of the samples times their density in sr⁻¹ at the cosine n·l."""
    return share * nl * LANE_INV_PI


@inner
def sample(x, y, square):
    """A direction around +Z over the disc's point (x, y), whose squared radius is `square`."""
    return x, y, math.sqrt(max(ZERO, ONE - square))


@inner
def frame(nx, ny, nz):
    """A tangent and bitangent for the unit normal (Duff et al., JCGT 2017)."""
    sign = ONE if nz >= ZERO else -ONE
    a = -ONE / (sign + nz)
    b = nx * ny * a
    return (
        ONE + sign * nx * nx * a, sign * b, -sign * nx,
        b, sign + ny * ny * a, -ny,
    )  # fmt: skip
