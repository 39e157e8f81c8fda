"""The two compiled steps of resampling: judging candidates, and drawing survivors from them."""

import numpy as np
from numba import njit

from samplers.sphere import pixels_of


@njit(nogil=True, cache=True)
def _spread(x):
    """The eight low bits of x, one apart."""
    x = (x | (x << 4)) & 0x0F0F
    x = (x | (x << 2)) & 0x3333
    return (x | (x << 1)) & 0x5555


@njit(nogil=True, cache=True, error_model="numpy")
def judge(
    direction, radiance, reflected, map_pdf, brdf_pdf, from_map, from_brdf, target, weight, place
):  # fmt: skip
    """Targets and resampling weights of candidates (rows,).

        target = luminance(L · f_r · cos);  weight = target / (m p_map + n p_BRDF)

    direction, reflected : (rows, 3); radiance : (H, 2H, 3); map_pdf, brdf_pdf : (rows,)
    place : (rows,) int32, along a Z-shaped curve over the map, on which neighbours stay near
    """
    height = len(radiance)
    row, column = np.empty(len(target), np.int32), np.empty(len(target), np.int32)
    pixels_of(direction, len(radiance), row, column)
    for i in range(len(target)):
        y, x = row[i], column[i]
        value = (
            0.2126 * np.float64(radiance[y, x, 0]) * reflected[i, 0]
            + 0.7152 * np.float64(radiance[y, x, 1]) * reflected[i, 1]
            + 0.0722 * np.float64(radiance[y, x, 2]) * reflected[i, 2]
        )
        density = np.float64(map_pdf[i]) * from_map + np.float64(brdf_pdf[i]) * from_brdf
        target[i] = value
        place[i] = 2 * _spread(256 * y // height) + _spread(128 * x // height)
        weight[i] = value / density if density > 0.0 else 0.0


@njit(nogil=True, cache=True, error_model="numpy")
def choose(direction, target, weight, place, u, survivors, scale):
    """Draw survivors (count, p, 3) in proportion to the weights (k, p), and what each stands for.

        scale = Σ weight / target of the survivor, in sr;  0 where no candidate carries light

    place : (k, p), in whose order the weights are summed, so that survivors share the map out
    u : (p,) in [0, 1); survivor s is where the running sum passes (s + u)/count of the whole
    """
    count, candidates = len(survivors), len(weight)
    order = np.empty(candidates, np.int64)
    for p in range(len(u)):
        # Candidates in the order of their places, each with its number in the low bits.
        for j in range(candidates):
            order[j] = np.int64(place[j, p]) * candidates + j
        order.sort()
        total, last = 0.0, 0
        for k in range(candidates):
            order[k] %= candidates
            w = weight[order[k], p]
            total += w
            last = k if w > 0.0 else last
        k = 0
        below = weight[order[0], p]
        for s in range(count):
            passed = (s + np.float64(u[p])) * total / count
            # The sum may end a rounding below what is to be passed: the last that weighs is meant.
            while k < last and below <= passed:
                k += 1
                below += weight[order[k], p]
            j = order[k]
            scale[s, p] = total / target[j, p] if total > 0.0 else 0.0
            for axis in range(3):
                survivors[s, p, axis] = direction[j, p, axis]
