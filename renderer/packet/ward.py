"""Ward's anisotropic lobe over a diffuse term, in float64: lobes may be as narrow as 10⁻⁴.

    T        = ((h·t/αx)² + (h·b/αy)²) / (h·n)²
    evaluate = ρd/π + ρs e^−T / (4π αx αy √(nl nv))
    pdf      = share · e^−T / (4π αx αy (v·h) (h·n)³) + (1 − share) · nl/π
    sample   = v mirrored at h with tan θ_h = √(−ln(1 − u₀)) along (αx cos 2πu₁, αy sin 2πu₁)

Ward, "Measuring and modeling anisotropic reflection", SIGGRAPH 1992, sampled as in Walter's notes
on it (2005). The tangent t runs around the +Y axis.
"""

import math

from renderer.packet import lambert
from renderer.packet.material_table import (
    ALPHA_X,
    ALPHA_Y,
    DIFFUSE,
    INV_PI,
    LEAST_SHARE,
    SPECULAR,
    luminance,
)
from samplers.compiled import kernel
from samplers.sphere import sine_cosine


@kernel
def tangents(nx, ny, nz):
    """The unit tangent across Y × n, X where the normal is along Y, and the bitangent."""
    length = math.sqrt(nz * nz + nx * nx)
    tx, ty, tz = (1.0, 0.0, 0.0) if length < 1e-6 else (nz / length, 0.0, -nx / length)
    return tx, ty, tz, ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx


@kernel
def specular_share(row):
    """Probability of sampling the lobe."""
    diffuse, specular = luminance(row, DIFFUSE), luminance(row, SPECULAR)
    if diffuse <= 0.0:
        return 1.0
    if specular <= 0.0:
        return 0.0
    return min(max(specular / (specular + diffuse), LEAST_SHARE), 1.0 - LEAST_SHARE)


@kernel
def _lobe(row, nx, ny, nz, vx, vy, vz, lx, ly, lz):
    """e^−T / (4π αx αy), v·h and n·h; zeros where no half vector is above the surface."""
    hx, hy, hz = vx + lx, vy + ly, vz + lz
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    if length == 0.0:
        return 0.0, 1.0, 1.0
    scale = 1.0 / length
    hx, hy, hz = hx * scale, hy * scale, hz * scale
    vh, nh = hx * vx + hy * vy + hz * vz, hx * nx + hy * ny + hz * nz
    if vh <= 0.0 or nh <= 0.0:
        return 0.0, 1.0, 1.0
    tx, ty, tz, bx, by, bz = tangents(nx, ny, nz)
    along = (hx * tx + hy * ty + hz * tz) / row[ALPHA_X]
    across = (hx * bx + hy * by + hz * bz) / row[ALPHA_Y]
    exponent = (along * along + across * across) / (nh * nh)
    return math.exp(-exponent) / (4.0 * math.pi * row[ALPHA_X] * row[ALPHA_Y]), vh, nh


@kernel
def evaluate_with_pdf(row, nx, ny, nz, vx, vy, vz, lx, ly, lz):
    """f_r per channel, and the density in sr⁻¹ with which `sample` draws l given v."""
    nv = nx * vx + ny * vy + nz * vz
    nl = nx * lx + ny * ly + nz * lz
    if nv <= 0.0 or nl <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    lobe, vh, nh = _lobe(row, nx, ny, nz, vx, vy, vz, lx, ly, lz)
    share, s = specular_share(row), lobe / math.sqrt(nl * nv)
    return (
        lambert.evaluate(row[DIFFUSE]) + row[SPECULAR] * s,
        lambert.evaluate(row[DIFFUSE + 1]) + row[SPECULAR + 1] * s,
        lambert.evaluate(row[DIFFUSE + 2]) + row[SPECULAR + 2] * s,
        (1.0 - share) * nl * INV_PI + share * (lobe / (vh * nh * nh * nh)),
    )


@kernel
def sample(row, nx, ny, nz, vx, vy, vz, u0, u1, u2):
    """A unit direction for numbers in [0, 1), u2 for the choice; it may be below the surface."""
    tx, ty, tz, bx, by, bz = tangents(nx, ny, nz)
    sine, cosine = sine_cosine(u1)
    if u2 >= specular_share(row):
        r = math.sqrt(u0)
        x, y, z = r * cosine, r * sine, math.sqrt(max(0.0, 1.0 - u0))
    else:
        cosine *= row[ALPHA_X]
        sine *= row[ALPHA_Y]
        tangent = math.sqrt(-math.log(1.0 - u0))
        x, y = tangent * cosine, tangent * sine
        length = math.sqrt(1.0 + x * x + y * y)
        x, y, z = x / length, y / length, 1.0 / length
    lx, ly, lz = (
        x * tx + y * bx + z * nx, x * ty + y * by + z * ny, x * tz + y * bz + z * nz,
    )  # fmt: skip
    if u2 < specular_share(row):
        twice = 2.0 * (vx * lx + vy * ly + vz * lz)
        lx, ly, lz = twice * lx - vx, twice * ly - vy, twice * lz - vz
    length = math.sqrt(lx * lx + ly * ly + lz * lz)
    return lx / length, ly / length, lz / length
