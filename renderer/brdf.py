"""Reflectance: Lambert, GGX under a dielectric coat or as a conductor, and Ward's model.

Each model has `evaluate` (f_r in sr⁻¹, without the cosine), `sample` and `pdf` (sr⁻¹), all compiled
and in float64 scalars. Directions are unit and point away from the surface: v to the eye, l to the
light; both are above the shading normal n where a value is asked for.

GGX: Walter et al., "Microfacet models for refraction through rough surfaces", EGSR 2007, with the
height-correlated Smith term and visible normals of Heitz (JCGT 2014 and 2018). Coat: the diffuse
base is attenuated by Fresnel transmission both ways and divided by its hemispherical mean (Kelemen
and Szirmay-Kalos, 2001), which keeps it reciprocal and below one. Ward: "Measuring and modeling
anisotropic reflection", SIGGRAPH 1992, sampled as in Walter's notes on it (2005).
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from renderer.materials import Coated, Conductor, Lambert, Material, Ward

LAMBERT, COATED, CONDUCTOR, WARD = range(4)
KIND, ALPHA_X, ALPHA_Y, IOR, DIFFUSE, SPECULAR, BASE_SCALE = 0, 1, 2, 3, 4, 7, 10
COLUMNS = 11
INV_PI = 1.0 / math.pi
LEAST_ALPHA = 1e-4


def pack(materials: list[Material]) -> NDArray[np.float64]:
    """The materials as the table (m, 11) that the compiled functions read."""
    table = np.zeros((len(materials), COLUMNS))
    for row, material in zip(table, materials, strict=True):
        match material:
            case Lambert(albedo):
                row[KIND] = LAMBERT
                row[DIFFUSE : DIFFUSE + 3] = albedo
            case Coated(albedo, roughness, ior):
                row[KIND] = COATED
                row[ALPHA_X] = row[ALPHA_Y] = max(roughness, LEAST_ALPHA)
                row[IOR] = ior
                row[DIFFUSE : DIFFUSE + 3] = albedo
                row[BASE_SCALE] = 1.0 / (1.0 - _mean_fresnel(ior))
            case Conductor(reflectance, roughness):
                row[KIND] = CONDUCTOR
                row[ALPHA_X] = row[ALPHA_Y] = max(roughness, LEAST_ALPHA)
                row[SPECULAR : SPECULAR + 3] = reflectance
            case Ward(diffuse, specular, roughness_x, roughness_y):
                row[KIND] = WARD
                row[ALPHA_X] = max(roughness_x, LEAST_ALPHA)
                row[ALPHA_Y] = max(roughness_y, LEAST_ALPHA)
                row[DIFFUSE : DIFFUSE + 3] = diffuse
                row[SPECULAR : SPECULAR + 3] = specular
    return table


def _mean_fresnel(ior: float) -> float:
    """Cosine-weighted hemispherical mean of the Fresnel reflectance, by Gauss quadrature."""
    node, weight = np.polynomial.legendre.leggauss(64)
    cosine = 0.5 * (node + 1.0)
    values = np.array([fresnel(c, ior) for c in cosine])
    return float(np.sum(weight * cosine * values))


@njit(nogil=True, cache=True)
def fresnel(cosine, ior):
    """Unpolarised Fresnel reflectance of a dielectric seen from outside."""
    g = math.sqrt(ior * ior - 1.0 + cosine * cosine)
    a = (g - cosine) / (g + cosine)
    b = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0)
    return 0.5 * a * a * (1.0 + b * b)


@njit(nogil=True, cache=True)
def _schlick(f0, cosine):
    m = 1.0 - cosine
    return f0 + (1.0 - f0) * m * m * m * m * m


@njit(nogil=True, cache=True)
def _half(vx, vy, vz, lx, ly, lz):
    """The unit half vector, and its cosine to v (and l)."""
    hx, hy, hz = vx + lx, vy + ly, vz + lz
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    if length == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    hx, hy, hz = hx / length, hy / length, hz / length
    return hx, hy, hz, hx * vx + hy * vy + hz * vz


@njit(nogil=True, cache=True)
def _ggx_density(alpha, nx, ny, nz, hx, hy, hz):
    """Density of microfacet normals; the sine comes from the cross product to keep its digits."""
    cosine = nx * hx + ny * hy + nz * hz
    if cosine <= 0.0:
        return 0.0
    cx, cy, cz = ny * hz - nz * hy, nz * hx - nx * hz, nx * hy - ny * hx
    a2 = alpha * alpha
    spread = (cx * cx + cy * cy + cz * cz) + a2 * cosine * cosine
    return a2 * INV_PI / (spread * spread)


@njit(nogil=True, cache=True)
def _smith_root(alpha, cosine):
    a2 = alpha * alpha
    return math.sqrt(a2 + (1.0 - a2) * cosine * cosine)


@njit(nogil=True, cache=True)
def _tangent_around_y(nx, ny, nz):
    """The unit tangent across Y × n; X where the normal is along Y."""
    length = math.sqrt(nz * nz + nx * nx)
    if length < 1e-6:
        return 1.0, 0.0, 0.0
    return nz / length, 0.0, -nx / length


@njit(nogil=True, cache=True)
def _ward_exponent(row, nx, ny, nz, hx, hy, hz):
    """tan²θ_h (cos²φ_h/αx² + sin²φ_h/αy²), and n·h."""
    tx, ty, tz = _tangent_around_y(nx, ny, nz)
    bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    along = (hx * tx + hy * ty + hz * tz) / row[ALPHA_X]
    across = (hx * bx + hy * by + hz * bz) / row[ALPHA_Y]
    cosine = hx * nx + hy * ny + hz * nz
    return (along * along + across * across) / (cosine * cosine), cosine


@njit(nogil=True, cache=True)
def evaluate(row, nx, ny, nz, vx, vy, vz, lx, ly, lz):
    """f_r per channel for v and l above the surface."""
    kind = int(row[KIND])
    if kind == LAMBERT:
        return row[DIFFUSE] * INV_PI, row[DIFFUSE + 1] * INV_PI, row[DIFFUSE + 2] * INV_PI
    nv = nx * vx + ny * vy + nz * vz
    nl = nx * lx + ny * ly + nz * lz
    hx, hy, hz, vh = _half(vx, vy, vz, lx, ly, lz)
    if vh <= 0.0:
        return 0.0, 0.0, 0.0
    if kind == WARD:
        exponent, nh = _ward_exponent(row, nx, ny, nz, hx, hy, hz)
        s = 0.0
        if nh > 0.0:
            s = math.exp(-exponent) / (
                4.0 * math.pi * row[ALPHA_X] * row[ALPHA_Y] * math.sqrt(nl * nv)
            )
        return (
            row[DIFFUSE] * INV_PI + row[SPECULAR] * s,
            row[DIFFUSE + 1] * INV_PI + row[SPECULAR + 1] * s,
            row[DIFFUSE + 2] * INV_PI + row[SPECULAR + 2] * s,
        )
    alpha = row[ALPHA_X]
    masking = 0.5 / (nl * _smith_root(alpha, nv) + nv * _smith_root(alpha, nl))
    s = _ggx_density(alpha, nx, ny, nz, hx, hy, hz) * masking
    if kind == CONDUCTOR:
        return (
            s * _schlick(row[SPECULAR], vh),
            s * _schlick(row[SPECULAR + 1], vh),
            s * _schlick(row[SPECULAR + 2], vh),
        )
    s *= fresnel(vh, row[IOR])
    base = INV_PI * row[BASE_SCALE] * (1.0 - fresnel(nv, row[IOR])) * (1.0 - fresnel(nl, row[IOR]))
    return row[DIFFUSE] * base + s, row[DIFFUSE + 1] * base + s, row[DIFFUSE + 2] * base + s


@njit(nogil=True, cache=True)
def _specular_share(row, nv):
    """Probability of sampling the specular lobe."""
    kind = int(row[KIND])
    if kind == LAMBERT:
        return 0.0
    if kind == CONDUCTOR:
        return 1.0
    diffuse = 0.2126 * row[DIFFUSE] + 0.7152 * row[DIFFUSE + 1] + 0.0722 * row[DIFFUSE + 2]
    if kind == COATED:
        specular = fresnel(nv, row[IOR])
        diffuse *= 1.0 - specular
    else:
        specular = 0.2126 * row[SPECULAR] + 0.7152 * row[SPECULAR + 1] + 0.0722 * row[SPECULAR + 2]
    if diffuse <= 0.0:
        return 1.0
    if specular <= 0.0:
        return 0.0
    return min(max(specular / (specular + diffuse), 0.1), 0.9)


@njit(nogil=True, cache=True)
def pdf(row, nx, ny, nz, vx, vy, vz, lx, ly, lz):
    """Density in sr⁻¹ with which `sample` draws l, given v."""
    nv = nx * vx + ny * vy + nz * vz
    nl = nx * lx + ny * ly + nz * lz
    if nv <= 0.0 or nl <= 0.0:
        return 0.0
    share = _specular_share(row, nv)
    result = (1.0 - share) * nl * INV_PI
    if share == 0.0:
        return result
    hx, hy, hz, vh = _half(vx, vy, vz, lx, ly, lz)
    if vh <= 0.0:
        return result
    if int(row[KIND]) == WARD:
        exponent, nh = _ward_exponent(row, nx, ny, nz, hx, hy, hz)
        if nh > 0.0:
            result += (
                share
                * math.exp(-exponent)
                / (4.0 * math.pi * row[ALPHA_X] * row[ALPHA_Y] * vh * nh * nh * nh)
            )
        return result
    alpha = row[ALPHA_X]
    density = _ggx_density(alpha, nx, ny, nz, hx, hy, hz)
    return result + share * density / (2.0 * (nv + _smith_root(alpha, nv)))


@njit(nogil=True, cache=True)
def frame(nx, ny, nz):
    """A tangent and bitangent for the unit normal (Duff et al., JCGT 2017)."""
    sign = math.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return (
        1.0 + sign * nx * nx * a, sign * b, -sign * nx,
        b, sign + ny * ny * a, -ny,
    )  # fmt: skip


@njit(nogil=True, cache=True)
def _visible_normal(alpha, x, y, z, u0, u1):
    """A GGX normal visible from (x, y, z), in the frame whose z is the normal (Heitz 2018)."""
    sx, sy, sz = alpha * x, alpha * y, z
    length = math.sqrt(sx * sx + sy * sy + sz * sz)
    sx, sy, sz = sx / length, sy / length, sz / length
    flat = sx * sx + sy * sy
    if flat > 0.0:
        scale = 1.0 / math.sqrt(flat)
        ax, ay = -sy * scale, sx * scale
    else:
        ax, ay = 1.0, 0.0
    bx, by, bz = -sz * ay, sz * ax, sx * ay - sy * ax
    r = math.sqrt(u0)
    p1 = r * math.cos(2.0 * math.pi * u1)
    p2 = r * math.sin(2.0 * math.pi * u1)
    s = 0.5 * (1.0 + sz)
    p2 = (1.0 - s) * math.sqrt(max(0.0, 1.0 - p1 * p1)) + s * p2
    p3 = math.sqrt(max(0.0, 1.0 - p1 * p1 - p2 * p2))
    mx = alpha * (p1 * ax + p2 * bx + p3 * sx)
    my = alpha * (p1 * ay + p2 * by + p3 * sy)
    mz = max(0.0, p2 * bz + p3 * sz)
    length = math.sqrt(mx * mx + my * my + mz * mz)
    return mx / length, my / length, mz / length


@njit(nogil=True, cache=True)
def _ward_half(row, u0, u1):
    """A half vector of Ward's lobe in the frame (tangent, bitangent, normal)."""
    cosine = row[ALPHA_X] * math.cos(2.0 * math.pi * u1)
    sine = row[ALPHA_Y] * math.sin(2.0 * math.pi * u1)
    tangent = math.sqrt(-math.log(1.0 - u0))
    x, y = tangent * cosine, tangent * sine
    length = math.sqrt(1.0 + x * x + y * y)
    return x / length, y / length, 1.0 / length


@njit(nogil=True, cache=True)
def sample(row, nx, ny, nz, vx, vy, vz, u0, u1, u2):
    """A direction l and its pdf, for random numbers in [0, 1); pdf 0 where l is below the surface.

    u2 chooses the lobe.
    """
    nv = nx * vx + ny * vy + nz * vz
    is_ward = int(row[KIND]) == WARD
    if is_ward:
        tx, ty, tz = _tangent_around_y(nx, ny, nz)
        bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    else:
        tx, ty, tz, bx, by, bz = frame(nx, ny, nz)
    if u2 >= _specular_share(row, nv):
        r = math.sqrt(u0)
        x, y = r * math.cos(2.0 * math.pi * u1), r * math.sin(2.0 * math.pi * u1)
        z = math.sqrt(max(0.0, 1.0 - u0))
        lx, ly, lz = (
            x * tx + y * bx + z * nx, x * ty + y * by + z * ny, x * tz + y * bz + z * nz,
        )  # fmt: skip
    else:
        if is_ward:
            x, y, z = _ward_half(row, u0, u1)
        else:
            x, y, z = _visible_normal(
                row[ALPHA_X],
                vx * tx + vy * ty + vz * tz,
                vx * bx + vy * by + vz * bz,
                nv,
                u0,
                u1,
            )
        hx, hy, hz = (
            x * tx + y * bx + z * nx, x * ty + y * by + z * ny, x * tz + y * bz + z * nz,
        )  # fmt: skip
        twice = 2.0 * (vx * hx + vy * hy + vz * hz)
        lx, ly, lz = twice * hx - vx, twice * hy - vy, twice * hz - vz
    length = math.sqrt(lx * lx + ly * ly + lz * lz)
    lx, ly, lz = lx / length, ly / length, lz / length
    return lx, ly, lz, pdf(row, nx, ny, nz, vx, vy, vz, lx, ly, lz)
