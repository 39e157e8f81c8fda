"""GGX microfacets with Schlick's Fresnel term: a rough metal, or the coat of `coated.py`.

    D        = α² / (π ((n·h)² (α² − 1) + 1)²)
    root(c)  = √(α² + (1 − α²) c²)
    evaluate = F D G / (4 nl nv) = ½ D F / (nl root(nv) + nv root(nl))
    pdf      = D G₁(v) / (4 nv) = ½ D / (nv + root(nv))
    sample   = v mirrored at a microfacet that is visible from v

Walter et al., "Microfacet models for refraction through rough surfaces", EGSR 2007; the
height-correlated Smith term and visible normals of Heitz, JCGT 2014 and 2018; Schlick, 1994. One
lane at a time; `alpha_2` is α².
"""

import math

from renderer.packet.layout import HALF, LANE_INV_PI, ONE, TINY, TWO, ZERO
from samplers.compiled import inner


@inner
def fifth_power(cosine):
    """(1 − cosine)⁵."""
    m = ONE - cosine
    return m * m * m * m * m


@inner
def fresnel(f0, power):
    """Schlick's reflectance; power : `fifth_power` of the cosine."""
    return f0 + (ONE - f0) * power


@inner
def smith_root(alpha_2, cosine):
    """√(α² + (1 − α²) cos²): Smith's masking is 2 cos / (cos + root)."""
    return math.sqrt(alpha_2 + (ONE - alpha_2) * cosine * cosine)


@inner
def half_vector(vx, vy, vz, lx, ly, lz):
    """The unit vector half way between v and l."""
    hx, hy, hz = vx + lx, vy + ly, vz + lz
    scale = ONE / math.sqrt(max(hx * hx + hy * hy + hz * hz, TINY))
    return hx * scale, hy * scale, hz * scale


@inner
def half_density(glossy, alpha_2, nx, ny, nz, hx, hy, hz):
    """D/2 where `glossy` is 1. The sine comes from the cross product, which keeps its digits."""
    nh = nx * hx + ny * hy + nz * hz
    cx, cy, cz = ny * hz - nz * hy, nz * hx - nx * hz, nx * hy - ny * hx
    spread = (cx * cx + cy * cy + cz * cz) + alpha_2 * nh * nh
    return HALF * glossy * alpha_2 * LANE_INV_PI / max(spread * spread, TINY)


@inner
def evaluate(half_d, alpha_2, nv, nl, root_v):
    """f_r in sr⁻¹ without Fresnel's term."""
    root_l = smith_root(alpha_2, nl)
    return half_d / max(abs(nl) * root_v + nv * root_l, TINY)


@inner
def pdf(share, half_d, nv, root_v):
    """`share` of the samples times their density in sr⁻¹."""
    return share * half_d / (nv + root_v)


@inner
def sample(alpha, x, y, z, p1, p2):
    """A microfacet's normal around +Z, not of unit length, visible from the unit (x, y, z).

    p1, p2 : a point that is uniform on the unit disc
    """
    sx, sy = alpha * x, alpha * y
    scale = ONE / math.sqrt(sx * sx + sy * sy + z * z)
    sx, sy, sz = sx * scale, sy * scale, z * scale
    flat = sx * sx + sy * sy
    scale = ONE / math.sqrt(max(flat, TINY))
    ax, ay = -sy * scale if flat > ZERO else ONE, sx * scale
    bx, by, bz = -sz * ay, sz * ax, sx * ay - sy * ax
    half = HALF * (ONE + sz)
    q2 = (ONE - half) * math.sqrt(max(ZERO, ONE - p1 * p1)) + half * p2
    q3 = math.sqrt(max(ZERO, ONE - p1 * p1 - q2 * q2))
    return (
        alpha * (p1 * ax + q2 * bx + q3 * sx),
        alpha * (p1 * ay + q2 * by + q3 * sy),
        max(ZERO, q2 * bz + q3 * sz),
    )


@inner
def mirrored(vx, vy, vz, hx, hy, hz):
    """v mirrored at the unit vector h."""
    twice = TWO * (vx * hx + vy * hy + vz * hz)
    return twice * hx - vx, twice * hy - vy, twice * hz - vz
