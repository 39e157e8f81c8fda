"""The two compiled steps of resampling: judging candidates, and drawing survivors from them."""

import numpy as np

from samplers.compiled import kernel
from samplers.sphere import pixels_of


@kernel
def _spread(x):
    """The eight low bits of x, one apart."""
    x = (x | (x << 4)) & 0x0F0F
    x = (x | (x << 2)) & 0x3333
    return (x | (x << 1)) & 0x5555


@kernel
def judge(
    direction, radiance, reflected, map_pdf, brdf_pdf, from_map, from_brdf, target, weight, place
):  # fmt: skip
    """Targets and resampling weights of candidates (rows,).

        target = luminance(L · f_r · cos);  weight = target / (m p_map + n p_BRDF)

    direction, reflected : (rows, 3); radiance : (H, 2H, 3); map_pdf, brdf_pdf : (rows,)
    place : (rows,) int32, sixteen bits along a Z-shaped curve over the map, on which neighbours
        stay near
    """
    height = len(radiance)
    row, column = np.empty(len(target), np.int32), np.empty(len(target), np.int32)
    pixels_of(direction, height, row, column)
    down, along = np.empty(height, np.int32), np.empty(2 * height, np.int32)
    for r in range(height):
        down[r] = 2 * _spread(256 * r // height)
    for c in range(2 * height):
        along[c] = _spread(128 * c // height)
    for i in range(len(target)):
        y, x = np.uint64(row[i]), np.uint64(column[i])
        value = (
            0.2126 * np.float64(radiance[y, x, 0]) * reflected[i, 0]
            + 0.7152 * np.float64(radiance[y, x, 1]) * reflected[i, 1]
            + 0.0722 * np.float64(radiance[y, x, 2]) * reflected[i, 2]
        )
        density = np.float64(map_pdf[i]) * from_map + np.float64(brdf_pdf[i]) * from_brdf
        target[i] = value
        place[i] = down[y] + along[x]
        weight[i] = value / density if density > 0.0 else 0.0


@kernel
def _by_digit(key, shift, given, found, begin):
    """Bring numbers into the order of eight bits of their keys; those of equal ones stay in order.

    given, found : (k,) the numbers before and after; begin : (257,) scratch
    """
    begin[:] = 0
    for i in range(np.uint64(len(given))):
        begin[np.uint64((key[given[i]] >> shift) & 255) + np.uint64(1)] += np.uint64(1)
    for d in range(np.uint64(256)):
        begin[d + np.uint64(1)] += begin[d]
    for i in range(np.uint64(len(given))):
        digit = np.uint64((key[given[i]] >> shift) & 255)
        found[begin[digit]] = given[i]
        begin[digit] += np.uint64(1)


@kernel
def choose(direction, target, weight, place, u, survivors, scale):
    """Draw survivors (count, p, 3) in proportion to the weights (k, p), and what each stands for.

        scale = Σ weight / target of the survivor, in sr;  0 where no candidate carries light

    place : (k, p), in whose order the weights are summed, so that survivors share the map out
    u : (p,) in [0, 1); survivor s is where the running sum passes (s + u)/count of the whole
    """
    count, candidates = len(survivors), len(weight)
    number, begin = np.arange(candidates).astype(np.uint64), np.empty(257, np.uint64)
    half, order = np.empty_like(number), np.empty_like(number)
    key, sorted_weight = np.empty(candidates, np.int32), np.empty(candidates)
    for p in range(np.uint64(len(u))):
        for j in number:
            key[j] = place[j, p]
        _by_digit(key, 0, number, half, begin)
        _by_digit(key, 8, half, order, begin)
        total, last = 0.0, 0
        for k in range(candidates):
            w = weight[order[k], p]
            sorted_weight[k] = w
            total += w
            last = k if w > 0.0 else last
        k = 0
        below = sorted_weight[0]
        for s in range(count):
            passed = (s + np.float64(u[p])) * total / count
            # The sum may end a rounding below what is to be passed: the last that weighs is meant.
            while k < last and below <= passed:
                k += 1
                below += sorted_weight[k]
            j = order[k]
            scale[s, p] = total / target[j, p] if total > 0.0 else 0.0
            for axis in range(3):
                survivors[s, p, axis] = direction[j, p, axis]
