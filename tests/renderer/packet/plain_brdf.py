"""Reflectance as plain formulas, one direction at a time in float64: the oracle of the lanes.

Each model has `evaluate` (f_r in sr⁻¹, without the cosine), `sample` and `pdf` (sr⁻¹). Directions
are unit and point away from the surface: v to the eye, l to the light; both are above the shading
normal n where a value is asked for. `row` is one of `material_table.pack`.
"""

import math

from numba import njit

from renderer.packet.material_table import (
    ALPHA_X,
    ALPHA_Y,
    BASE_SCALE,
    COAT,
    COATED,
    CONDUCTOR,
    DIFFUSE,
    KIND,
    LAMBERT,
    LEAST_SHARE,
    SPECULAR,
    WARD,
)
from samplers.sphere import sine_cosine

INV_PI = 1.0 / math.pi


@njit(cache=True)
def _schlick(f0, cosine):
    m = 1.0 - cosine
    return f0 + (1.0 - f0) * m * m * m * m * m


@njit(cache=True)
def _half(vx, vy, vz, lx, ly, lz):
    """The unit half vector, and its cosine to v (and l)."""
    hx, hy, hz = vx + lx, vy + ly, vz + lz
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    if length == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    scale = 1.0 / length
    hx, hy, hz = hx * scale, hy * scale, hz * scale
    return hx, hy, hz, hx * vx + hy * vy + hz * vz


@njit(cache=True)
def _ggx_density(alpha, nx, ny, nz, hx, hy, hz):
    """Density of microfacet normals; the sine comes from the cross product to keep its digits."""
    cosine = nx * hx + ny * hy + nz * hz
    if cosine <= 0.0:
        return 0.0
    cx, cy, cz = ny * hz - nz * hy, nz * hx - nx * hz, nx * hy - ny * hx
    a2 = alpha * alpha
    spread = (cx * cx + cy * cy + cz * cz) + a2 * cosine * cosine
    return a2 * INV_PI / (spread * spread)


@njit(cache=True)
def _smith_root(alpha, cosine):
    a2 = alpha * alpha
    return math.sqrt(a2 + (1.0 - a2) * cosine * cosine)


@njit(cache=True)
def _tangent_around_y(nx, ny, nz):
    """The unit tangent across Y × n; X where the normal is along Y."""
    length = math.sqrt(nz * nz + nx * nx)
    if length < 1e-6:
        return 1.0, 0.0, 0.0
    return nz / length, 0.0, -nx / length


@njit(cache=True)
def _ward_exponent(row, nx, ny, nz, hx, hy, hz):
    """tan²θ_h (cos²φ_h/αx² + sin²φ_h/αy²), and n·h."""
    tx, ty, tz = _tangent_around_y(nx, ny, nz)
    bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    along = (hx * tx + hy * ty + hz * tz) / row[ALPHA_X]
    across = (hx * bx + hy * by + hz * bz) / row[ALPHA_Y]
    cosine = hx * nx + hy * ny + hz * nz
    return (along * along + across * across) / (cosine * cosine), cosine


@njit(cache=True)
def luminance(row, first):
    """Luminance of the colour that begins in column `first`."""
    return 0.2126 * row[first] + 0.7152 * row[first + 1] + 0.0722 * row[first + 2]


@njit(cache=True)
def specular_share(row, coat):
    """Probability of sampling the specular lobe; `coat` is the coat's reflectance towards v."""
    kind = int(row[KIND])
    if kind == LAMBERT:
        return 0.0
    if kind == CONDUCTOR:
        return 1.0
    diffuse = luminance(row, DIFFUSE)
    if kind == COATED:
        specular = coat
        diffuse *= 1.0 - specular
    else:
        specular = luminance(row, SPECULAR)
    if diffuse <= 0.0:
        return 1.0
    if specular <= 0.0:
        return 0.0
    return min(max(specular / (specular + diffuse), LEAST_SHARE), 1.0 - LEAST_SHARE)


@njit(cache=True)
def _ward(row, nx, ny, nz, hx, hy, hz, vh, nv, nl):
    """Ward's specular term without its colour, and the density of its samples."""
    exponent, nh = _ward_exponent(row, nx, ny, nz, hx, hy, hz)
    if nh <= 0.0:
        return 0.0, 0.0
    lobe = math.exp(-exponent) / (4.0 * math.pi * row[ALPHA_X] * row[ALPHA_Y])
    return lobe / math.sqrt(nl * nv), lobe / (vh * nh * nh * nh)


@njit(cache=True)
def evaluate_with_pdf(row, nx, ny, nz, vx, vy, vz, lx, ly, lz):
    """f_r per channel, and the density in sr⁻¹ with which `sample` draws l given v."""
    nv = nx * vx + ny * vy + nz * vz
    nl = nx * lx + ny * ly + nz * lz
    if nv <= 0.0 or nl <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    kind = int(row[KIND])
    red, green, blue = row[DIFFUSE] * INV_PI, row[DIFFUSE + 1] * INV_PI, row[DIFFUSE + 2] * INV_PI
    if kind == LAMBERT:
        return red, green, blue, nl * INV_PI
    coat = _schlick(row[COAT], nv) if kind == COATED else 0.0
    share = specular_share(row, coat)
    density = (1.0 - share) * nl * INV_PI
    hx, hy, hz, vh = _half(vx, vy, vz, lx, ly, lz)
    if kind == WARD:
        s, lobe = _ward(row, nx, ny, nz, hx, hy, hz, vh, nv, nl) if vh > 0.0 else (0.0, 0.0)
        return (
            red + row[SPECULAR] * s,
            green + row[SPECULAR + 1] * s,
            blue + row[SPECULAR + 2] * s,
            density + share * lobe,
        )
    alpha = row[ALPHA_X]
    distribution = _ggx_density(alpha, nx, ny, nz, hx, hy, hz)
    root_v, root_l = _smith_root(alpha, nv), _smith_root(alpha, nl)
    s = 0.5 * distribution / (nl * root_v + nv * root_l)
    density += share * 0.5 * distribution / (nv + root_v)
    if kind == CONDUCTOR:
        return (
            s * _schlick(row[SPECULAR], vh),
            s * _schlick(row[SPECULAR + 1], vh),
            s * _schlick(row[SPECULAR + 2], vh),
            density,
        )
    s *= _schlick(row[COAT], vh)
    base = row[BASE_SCALE] * (1.0 - coat) * (1.0 - _schlick(row[COAT], nl))
    return red * base + s, green * base + s, blue * base + s, density


@njit(cache=True)
def evaluate(row, nx, ny, nz, vx, vy, vz, lx, ly, lz):
    """f_r per channel for v and l above the surface, 0 elsewhere."""
    red, green, blue, _ = evaluate_with_pdf(row, nx, ny, nz, vx, vy, vz, lx, ly, lz)
    return red, green, blue


@njit(cache=True)
def pdf(row, nx, ny, nz, vx, vy, vz, lx, ly, lz):
    """Density in sr⁻¹ with which `sample` draws l, given v."""
    return evaluate_with_pdf(row, nx, ny, nz, vx, vy, vz, lx, ly, lz)[3]


@njit(cache=True)
def frame(nx, ny, nz):
    """A tangent and bitangent for the unit normal (Duff et al., JCGT 2017)."""
    sign = math.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return (
        1.0 + sign * nx * nx * a, sign * b, -sign * nx,
        b, sign + ny * ny * a, -ny,
    )  # fmt: skip


@njit(cache=True)
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
    sine, cosine = sine_cosine(u1)
    p1, p2 = r * cosine, r * sine
    s = 0.5 * (1.0 + sz)
    p2 = (1.0 - s) * math.sqrt(max(0.0, 1.0 - p1 * p1)) + s * p2
    p3 = math.sqrt(max(0.0, 1.0 - p1 * p1 - p2 * p2))
    mx = alpha * (p1 * ax + p2 * bx + p3 * sx)
    my = alpha * (p1 * ay + p2 * by + p3 * sy)
    mz = max(0.0, p2 * bz + p3 * sz)
    length = math.sqrt(mx * mx + my * my + mz * mz)
    return mx / length, my / length, mz / length


@njit(cache=True)
def _ward_half(row, u0, u1):
    """A half vector of Ward's lobe in the frame (tangent, bitangent, normal)."""
    sine, cosine = sine_cosine(u1)
    cosine *= row[ALPHA_X]
    sine *= row[ALPHA_Y]
    tangent = math.sqrt(-math.log(1.0 - u0))
    x, y = tangent * cosine, tangent * sine
    length = math.sqrt(1.0 + x * x + y * y)
    return x / length, y / length, 1.0 / length


@njit(cache=True)
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
    coat = _schlick(row[COAT], nv) if int(row[KIND]) == COATED else 0.0
    if u2 >= specular_share(row, coat):
        r = math.sqrt(u0)
        sine, cosine = sine_cosine(u1)
        x, y = r * cosine, r * sine
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
