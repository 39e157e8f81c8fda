"""The two steps of resampling: judging candidates, and drawing survivors from them."""

import numpy as np

from samplers.compiled import inner, kernel
from samplers.sphere import pixels_of

FEW = 32
"""So many candidates at most are sorted by insertion, which is quicker for them than by digits."""
BELOW_ONE = 1.0 - 2.0**-24
"""The largest float32 below 1."""


@kernel
def _spread(x):
    """The eight low bits of x, one apart."""
    x = (x | (x << 4)) & 0x0F0F
    x = (x | (x << 2)) & 0x3333
    return (x | (x << 1)) & 0x5555


@kernel
def _gathered(x):
    """The inverse of `_spread`, of every second bit of sixteen."""
    x &= 0x5555
    x = (x | (x >> 1)) & 0x3333
    x = (x | (x >> 2)) & 0x0F0F
    return (x | (x >> 4)) & 0x00FF


@kernel
def curve_of(height):
    """Where rows (h,) and columns (2h,) of a map lie on a Z-shaped curve over it: their sum is
    sixteen bits of a texel's place, near those of its neighbours.
    """
    down, along = np.empty(height, np.int32), np.empty(2 * height, np.int32)
    for r in range(height):
        down[r] = 2 * _spread(256 * r // height)
    for c in range(2 * height):
        along[c] = _spread(128 * c // height)
    return down, along


@kernel
def along_curve(u, count, found):
    """Numbers (sets · count, p, 3) of which each set's lie one after the other on the curve over
    the unit square: the first, of a candidate's own share of it, says where in 65536 cells.
    """
    for j in range(len(u)):
        for p in range(u.shape[1]):
            place = (j % count + np.float64(u[j, p, 0])) / count * 65536.0
            cell = int(place)
            column, row = _gathered(cell), _gathered(cell >> 1)
            found[j, p, 0] = min((column + place - cell) / 256.0, BELOW_ONE)
            found[j, p, 1] = min((row + np.float64(u[j, p, 1])) / 256.0, BELOW_ONE)
            found[j, p, 2] = u[j, p, 2]


@inner
def judged(
    light_r, light_g, light_b, reflected_r, reflected_g, reflected_b, map_pdf, brdf_pdf, from_map,
    from_brdf,
):  # fmt: skip
    """Target and resampling weight of a candidate, by its radiance and its f_r · cos.

    target = luminance(L · f_r · cos);  weight = target / (m p_map + n p_BRDF)
    """
    target = (
        0.2126 * light_r * reflected_r
        + 0.7152 * light_g * reflected_g
        + 0.0722 * light_b * reflected_b
    )
    density = map_pdf * from_map + brdf_pdf * from_brdf
    return target, target / density if density > 0.0 else 0.0


@kernel
def judge(
    direction, radiance, reflected, map_pdf, brdf_pdf, from_map, from_brdf, curve, target, weight,
    place,
):  # fmt: skip
    """Targets, resampling weights and places along the curve of candidates (rows,).

    direction, reflected : (rows, 3); radiance : (H, 2H, 3); map_pdf, brdf_pdf : (rows,)
    curve : see `curve_of`; two empty arrays for no places
    """
    down, along = curve
    row, column = np.empty(len(target), np.int32), np.empty(len(target), np.int32)
    pixels_of(direction, len(radiance), row, column)
    for i in range(len(target)):
        y, x = np.uint64(row[i]), np.uint64(column[i])
        target[i], weight[i] = judged(
            np.float64(radiance[y, x, 0]), np.float64(radiance[y, x, 1]),
            np.float64(radiance[y, x, 2]), reflected[i, 0], reflected[i, 1], reflected[i, 2],
            np.float64(map_pdf[i]), np.float64(brdf_pdf[i]), from_map, from_brdf,
        )  # fmt: skip
        if len(down) > 0:
            place[i] = down[y] + along[x]


@kernel
def room_for(candidates):
    """What `choose_at` works in."""
    return (
        np.empty(candidates, np.int32), np.empty(candidates), np.empty(candidates, np.uint64),
        np.empty(candidates, np.uint64), np.empty(257, np.uint64),
    )  # fmt: skip


@inner
def _by_digit(key, shift, given, found, begin):
    """Bring numbers into the order of eight bits of their keys; those of equal ones stay in order.

    given, found : (k,) the numbers before and after; begin : (257,)
    """
    for d in range(np.uint64(257)):
        begin[d] = np.uint64(0)
    for i in range(np.uint64(len(given))):
        begin[np.uint64((key[given[i]] >> shift) & 255) + np.uint64(1)] += np.uint64(1)
    for d in range(np.uint64(256)):
        begin[d + np.uint64(1)] += begin[d]
    for i in range(np.uint64(len(given))):
        digit = np.uint64((key[given[i]] >> shift) & 255)
        found[begin[digit]] = given[i]
        begin[digit] += np.uint64(1)


@inner
def _sort(key, half, order, begin):
    """The numbers of sixteen-bit keys (k,), in their order, into order (k,)."""
    if len(key) <= FEW:
        for i in range(len(key)):
            j = i
            while j > 0 and key[order[j - 1]] > key[i]:
                order[j] = order[j - 1]
                j -= 1
            order[j] = i
        return
    for i in range(np.uint64(len(key))):
        order[i] = i
    _by_digit(key, 0, order, half, begin)
    _by_digit(key, 8, half, order, begin)


@inner
def choose_at(p, target, weight, place, u, room, chosen, scale):
    """Draw the survivors of point p in proportion to the weights of its candidates.

    target, weight, place : (k, points), in whose places' order the weights are summed, so that
        survivors share the map out
    u : in [0, 1); survivor s is where the running sum passes (s + u)/count of the whole
    chosen, scale : (count, points), numbers of candidates and Σ weight / target of each, in sr;
        0 where no candidate carries light
    """
    key, sorted_weight, half, order, begin = room
    count = len(chosen)
    for j in range(len(key)):
        key[j] = place[j, p]
    _sort(key, half, order, begin)
    total, last = 0.0, 0
    for k in range(len(key)):
        w = weight[order[k], p]
        sorted_weight[k] = w
        total += w
        last = k if w > 0.0 else last
    k = 0
    below = sorted_weight[0]
    for s in range(count):
        passed = (s + u) * total / count
        # The sum may end a rounding below what is to be passed: the last that weighs is meant.
        while k < last and below <= passed:
            k += 1
            below += sorted_weight[k]
        chosen[s, p] = order[k]
        scale[s, p] = total / target[order[k], p] if total > 0.0 else 0.0


@inner
def _place_of(i, s, count, number):
    """Where candidate i of set s stands among those of all sets: see `choose_of_set`."""
    if i < number[0]:
        return s * number[0] + i
    return count * number[0] + s * number[1] + i - number[0]


@inner
def choose_of_set(p, target, weight, number, u, s, chosen, scale):
    """Draw survivor s of point p from the candidates of its own set, in proportion to weights.

    target, weight : (k, points), the sets' candidates of the map first, then those of the BRDF
    number : (m, n) of a set's candidates; their weights are 1/count of what they are in the set
    u : in [0, 1); chosen, scale : as of `choose_at`
    """
    count = len(chosen)
    total, last = 0.0, 0
    for i in range(number[0] + number[1]):
        j = _place_of(i, s, count, number)
        total += weight[j, p]
        last = j if weight[j, p] > 0.0 else last
    passed, below, j = u * total, 0.0, 0
    for i in range(number[0] + number[1]):
        j = _place_of(i, s, count, number)
        below += weight[j, p]
        if below > passed or j == last:
            break
    chosen[s, p] = j
    scale[s, p] = count * total / target[j, p] if total > 0.0 else 0.0


@kernel
def choose_of_sets(target, weight, number, u, chosen, scale):
    """`choose_of_set` for all points and survivors, by u (count, p)."""
    for p in range(u.shape[1]):
        for s in range(len(u)):
            choose_of_set(p, target, weight, number, np.float64(u[s, p]), s, chosen, scale)


@kernel
def choose(target, weight, place, u, chosen, scale):
    """`choose_at` for all points, by u (p,)."""
    room = room_for(len(weight))
    for p in range(len(u)):
        choose_at(p, target, weight, place, np.float64(u[p]), room, chosen, scale)
