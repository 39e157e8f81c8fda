"""Reflectance as plain formulas, one direction at a time in float64: the oracle of the lanes.

Each model has `evaluate` (f_r in sr⁻¹, without the cosine), `sample` and `pdf` (sr⁻¹). Directions
are unit and point away from the surface: v to the eye, d to the light; both are above the shading
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
def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True)
def cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def combined(x, a, y, b, z, c):
    """x a + y b + z c."""
    return (
        x * a[0] + y * b[0] + z * c[0],
        x * a[1] + y * b[1] + z * c[1],
        x * a[2] + y * b[2] + z * c[2],
    )


@njit(cache=True)
def unit(a):
    length = math.sqrt(dot(a, a))
    return a[0] / length, a[1] / length, a[2] / length


@njit(cache=True)
def _ggx_density(alpha, n, h):
    """Density of microfacet normals; the sine comes from the cross product to keep its digits."""
    cosine, sine = dot(n, h), cross(n, h)
    if cosine <= 0.0:
        return 0.0
    a2 = alpha * alpha
    spread = dot(sine, sine) + a2 * cosine * cosine
    return a2 * INV_PI / (spread * spread)


@njit(cache=True)
def _smith_root(alpha, cosine):
    a2 = alpha * alpha
    return math.sqrt(a2 + (1.0 - a2) * cosine * cosine)


@njit(cache=True)
def tangents_around_y(n):
    """The unit tangent across Y × n, X where the normal is along Y, and the bitangent."""
    length = math.sqrt(n[2] * n[2] + n[0] * n[0])
    t = (1.0, 0.0, 0.0) if length < 1e-6 else (n[2] / length, 0.0, -n[0] / length)
    return t, cross(n, t)


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
def _ward(row, n, v, d, h):
    """Ward's specular term without its colour, and the density of its samples."""
    vh, nh = dot(v, h), dot(n, h)
    if vh <= 0.0 or nh <= 0.0:
        return 0.0, 0.0
    t, b = tangents_around_y(n)
    along, across = dot(h, t) / row[ALPHA_X], dot(h, b) / row[ALPHA_Y]
    lobe = math.exp(-(along * along + across * across) / (nh * nh))
    lobe /= 4.0 * math.pi * row[ALPHA_X] * row[ALPHA_Y]
    return lobe / math.sqrt(dot(n, d) * dot(n, v)), lobe / (vh * nh * nh * nh)


@njit(cache=True)
def evaluate_with_pdf(row, n, v, d):
    """f_r per channel, and the density in sr⁻¹ with which `sample` draws d given v."""
    nv, nl = dot(n, v), dot(n, d)
    if nv <= 0.0 or nl <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    kind = int(row[KIND])
    red, green, blue = row[DIFFUSE] * INV_PI, row[DIFFUSE + 1] * INV_PI, row[DIFFUSE + 2] * INV_PI
    if kind == LAMBERT:
        return red, green, blue, nl * INV_PI
    coat = _schlick(row[COAT], nv) if kind == COATED else 0.0
    share = specular_share(row, coat)
    density = (1.0 - share) * nl * INV_PI
    h = unit((v[0] + d[0], v[1] + d[1], v[2] + d[2]))
    if kind == WARD:
        s, lobe = _ward(row, n, v, d, h)
        return (
            red + row[SPECULAR] * s,
            green + row[SPECULAR + 1] * s,
            blue + row[SPECULAR + 2] * s,
            density + share * lobe,
        )
    alpha, vh = row[ALPHA_X], dot(v, h)
    distribution = _ggx_density(alpha, n, h)
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
def evaluate(row, n, v, d):
    """f_r per channel for v and d above the surface, 0 elsewhere."""
    return evaluate_with_pdf(row, n, v, d)[:3]


@njit(cache=True)
def pdf(row, n, v, d):
    """Density in sr⁻¹ with which `sample` draws d, given v."""
    return evaluate_with_pdf(row, n, v, d)[3]


@njit(cache=True)
def frame(n):
    """A tangent and bitangent for the unit normal (Duff et al., JCGT 2017)."""
    sign = math.copysign(1.0, n[2])
    a = -1.0 / (sign + n[2])
    b = n[0] * n[1] * a
    tangent = (1.0 + sign * n[0] * n[0] * a, sign * b, -sign * n[0])
    return tangent, (b, sign + n[1] * n[1] * a, -n[1])


@njit(cache=True)
def _visible_normal(alpha, view, p1, p2):
    """A GGX normal visible from `view`, in the frame whose z is the normal (Heitz 2018).

    p1, p2 : a point that is uniform on the unit disc"""
    s = unit((alpha * view[0], alpha * view[1], view[2]))
    flat = math.sqrt(s[0] * s[0] + s[1] * s[1])
    a = (-s[1] / flat, s[0] / flat, 0.0) if flat > 0.0 else (1.0, 0.0, 0.0)
    half = 0.5 * (1.0 + s[2])
    p2 = (1.0 - half) * math.sqrt(max(0.0, 1.0 - p1 * p1)) + half * p2
    p3 = math.sqrt(max(0.0, 1.0 - p1 * p1 - p2 * p2))
    m = combined(p1, a, p2, cross(s, a), p3, s)
    return unit((alpha * m[0], alpha * m[1], max(0.0, m[2])))


@njit(cache=True)
def sample(row, n, v, u):
    """A direction d and its pdf, for numbers u (3,) in [0, 1); pdf 0 where d is below the surface.

    u[2] chooses the lobe."""
    nv, kind = dot(n, v), int(row[KIND])
    t, b = tangents_around_y(n) if kind == WARD else frame(n)
    coat = _schlick(row[COAT], nv) if kind == COATED else 0.0
    diffuse = u[2] >= specular_share(row, coat)
    sine, cosine = sine_cosine(u[1])
    r = math.sqrt(u[0])
    if diffuse:
        local = (r * cosine, r * sine, math.sqrt(max(0.0, 1.0 - u[0])))
    elif kind == WARD:
        tangent = math.sqrt(-math.log(1.0 - u[0]))
        local = unit((tangent * cosine * row[ALPHA_X], tangent * sine * row[ALPHA_Y], 1.0))
    else:
        local = _visible_normal(row[ALPHA_X], (dot(v, t), dot(v, b), nv), r * cosine, r * sine)
    d = combined(local[0], t, local[1], b, local[2], n)
    if not diffuse:
        d = combined(2.0 * dot(v, d), d, -1.0, v, 0.0, n)
    d = unit(d)
    return d, pdf(row, n, v, d)
