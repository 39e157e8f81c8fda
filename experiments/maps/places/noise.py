"""Textures that know how much of them a texel can show.

Fractal gradient noise in three dimensions, evaluated at points in space, so that it has neither a
seam nor a pinch at the poles. An octave whose period comes near the width of the sample is faded
out before it can alias; what remains at a low resolution is the blurred picture, not another one.
Stripes and grids are integrated over the width of the sample in closed form.

Source: Perlin, "An image synthesizer", SIGGRAPH 1985 (lattice noise, sums over octaves), with the
quintic fade of Perlin, "Improving noise", SIGGRAPH 2002. Gradients come from a hash of the lattice
point instead of a permutation table, so that a pattern never repeats. Norton, Rockwood & Skolmoski,
"Clamping: a method of antialiasing textured surfaces by bandwidth limiting in object space",
SIGGRAPH 1982 (octaves fade with the width of the sample).
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from experiments.maps.places.shapes import Array
from samplers.compiled import inner, kernel

LANES = 16
"""Points whose noise is found side by side."""
PRIME_X, PRIME_Y, PRIME_Z, PRIME_SEED = 73856093, 19349663, 83492791, 40503749


@inner
def _mixed(key):
    """32 well mixed bits of the 32 low ones of a number."""
    h = np.uint32(key)
    h = np.uint32((h ^ (h >> 16)) * 0x2C1B3C6D)
    h = np.uint32((h ^ (h >> 12)) * 0x297A2D39)
    return np.uint32(h ^ (h >> 15))


@inner
def _corner(key, x, y, z):
    """The ramp of a lattice point: its random gradient times the way from it."""
    h = _mixed(key)
    a, b, c = np.int32(h & 1023), np.int32((h >> 10) & 1023), np.int32((h >> 20) & 1023)
    return ((a * x + b * y + c * z) * (2.0 / 1023.0)) - (x + y + z)


@inner
def _gradient_noise(x, y, z, seed):
    """Gradient noise of period 1 with a standard deviation near 0.25; seed : 32 bits of its own."""
    fx, fy, fz = math.floor(x), math.floor(y), math.floor(z)
    x, y, z = x - fx, y - fy, z - fz
    a0, b0 = np.uint32(np.int32(fx) * PRIME_X), np.uint32(np.int32(fy) * PRIME_Y)
    c0 = np.uint32(np.int32(fz) * PRIME_Z)
    a1, b1, c1 = np.uint32(a0 + PRIME_X), np.uint32(b0 + PRIME_Y), np.uint32(c0 + PRIME_Z) ^ seed
    c0 ^= seed
    u = x * x * x * (x * (x * 6.0 - 15.0) + 10.0)
    v = y * y * y * (y * (y * 6.0 - 15.0) + 10.0)
    w = z * z * z * (z * (z * 6.0 - 15.0) + 10.0)
    n000, n100 = _corner(a0 ^ b0 ^ c0, x, y, z), _corner(a1 ^ b0 ^ c0, x - 1.0, y, z)
    n010, n110 = _corner(a0 ^ b1 ^ c0, x, y - 1.0, z), _corner(a1 ^ b1 ^ c0, x - 1.0, y - 1.0, z)
    z1 = z - 1.0
    n001, n101 = _corner(a0 ^ b0 ^ c1, x, y, z1), _corner(a1 ^ b0 ^ c1, x - 1.0, y, z1)
    n011, n111 = _corner(a0 ^ b1 ^ c1, x, y - 1.0, z1), _corner(a1 ^ b1 ^ c1, x - 1.0, y - 1.0, z1)
    n00, n10 = n000 + u * (n100 - n000), n010 + u * (n110 - n010)
    n01, n11 = n001 + u * (n101 - n001), n011 + u * (n111 - n011)
    n0, n1 = n00 + v * (n10 - n00), n01 + v * (n11 - n01)
    return n0 + w * (n1 - n0)


@inner
def _add_octave(place, width, frequency, amplitude, seed, ridged, total):
    """Add an octave at sixteen places (48,) to their totals (16,), and move on to the next.

    The rotation between octaves keeps their lattices from lining up.
    """
    of_seed = np.uint32(seed * PRIME_SEED)
    for k in range(LANES):
        x, y, z = place[k], place[LANES + k], place[2 * LANES + k]
        fade = min(max(2.0 - 4.0 * frequency * width[k], 0.0), 1.0)
        value = _gradient_noise(x, y, z, of_seed)
        value = 0.35 - 2.0 * abs(value) if ridged else value
        total[k] += amplitude * fade * value
        place[k] = 2.03 * (0.8 * x - 0.6 * z)
        place[LANES + k] = 2.03 * (0.36 * x + 0.8 * y + 0.48 * z)
        place[2 * LANES + k] = 2.03 * (0.48 * x - 0.6 * y + 0.64 * z)


@kernel
def _fractal(points, width, octaves, gain, seed, ridged, out):
    place, thickness, total = np.empty(3 * LANES), np.empty(LANES), np.empty(LANES)
    for first in range(0, len(points), LANES):
        used, least = min(LANES, len(points) - first), np.inf
        for k in range(LANES):
            i = first + min(k, used - 1)
            for axis in range(3):
                place[axis * LANES + k] = points[i, axis]
            thickness[k], total[k] = width[i], 0.0
            least = min(least, width[i])
        frequency, amplitude = 1.0, 1.0
        for octave in range(octaves):
            if 2.0 - 4.0 * frequency * least <= 0.0:
                break
            _add_octave(place, thickness, frequency, amplitude, seed + octave, ridged, total)
            frequency *= 2.03
            amplitude *= gain
        for k in range(used):
            out[first + k] = total[k]


def fractal(
    points: ArrayLike,
    width: ArrayLike = 0.0,
    scale: float | tuple[float, float, float] = 1.0,
    octaves: int = 6,
    gain: float = 0.5,
    seed: int = 0,
    ridged: bool = False,
) -> Array:
    """Fractal noise (n,) at the points (n, 3): mean 0, values mostly within ±0.7.

    width : (n,) or a number, the size of the sample in the unit of the points
    scale : size of the largest features along x, y, z in that unit
    ridged : creases instead of swells, for rock and for mountains
    """
    size = np.broadcast_to(np.asarray(scale, np.float64), 3)
    scaled = np.ascontiguousarray(np.asarray(points, np.float64) / size)
    relative = np.ascontiguousarray(
        np.broadcast_to(np.asarray(width, np.float64) / size.min(), len(scaled))
    )
    out = np.empty(len(scaled))
    _fractal(scaled, relative, octaves, gain, seed, ridged, out)
    return out


@kernel
def _cell_random(i, j, seed, out):
    for n in range(len(out)):
        key = (i[n] * PRIME_X) ^ (j[n] * PRIME_Y) ^ (seed * PRIME_SEED)
        out[n] = _mixed(key) / 4294967296.0


def cell_random(i: ArrayLike, j: ArrayLike = 0, seed: int = 0) -> Array:
    """A uniform number in [0, 1) for each pair of integer cell indices (n,)."""
    first, second = np.broadcast_arrays(np.asarray(i), np.asarray(j))
    shape = first.shape
    flat = [np.ascontiguousarray(index.ravel().astype(np.int64)) for index in (first, second)]
    out = np.empty(len(flat[0]))
    _cell_random(flat[0], flat[1], seed, out)
    return out.reshape(shape)


def stripes(x: ArrayLike, period: float, thickness: float, width: ArrayLike) -> Array:
    """Share of the interval of `width` round x covered by stripes [k·period, k·period + thickness).

    The box filter is exact: the difference of the stripes' integral at the two ends.
    """
    x = np.asarray(x, np.float64)
    half = 0.5 * np.maximum(np.asarray(width, np.float64), 1e-6 * period)

    def integral(at: Array) -> Array:
        whole = np.floor(at / period)
        return whole * thickness + np.minimum(at - whole * period, thickness)

    return (integral(x + half) - integral(x - half)) / (2.0 * half)


def smoothstep(low: ArrayLike, high: ArrayLike, x: ArrayLike) -> Array:
    """0 below `low`, 1 above `high`, a cubic between."""
    a, b = np.asarray(low, np.float64), np.asarray(high, np.float64)
    t = np.clip((np.asarray(x, np.float64) - a) / (b - a), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def mix(a: ArrayLike, b: ArrayLike, t: ArrayLike) -> Array:
    """a + t (b − a); t (n,) mixes colours (3,) or (n, 3) into (n, 3)."""
    a, b, t = np.asarray(a, np.float64), np.asarray(b, np.float64), np.asarray(t, np.float64)
    if t.ndim == 1 and (a.ndim and b.ndim):
        t = t[:, None]
    return a + t * (b - a)
