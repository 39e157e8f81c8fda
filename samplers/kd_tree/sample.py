"""Drawing directions from the blocks of a kd-tree: sixteen at a time, or one by one for variants.

A block comes from the law, from an alias table, or from a walk down the tree: at each cut one of
the first two random numbers, the one along the cut's axis, chooses the side by its energy and is
stretched to [0, 1) again, so that neighbouring numbers stay neighbours. After Clarberg, Jarosz,
Akenine-Möller and Jensen, "Wavelet importance sampling", SIGGRAPH 2005, section 4.

The scratch arrays of the sixteen have one row per quantity, at constant places, so that the
compiler sees that rows do not overlap; all but the look-ups become vector instructions.
"""

import math

import numpy as np

from samplers.compiled import kernel
from samplers.kd_tree.fit import density_at
from samplers.sphere import RUN, TWO_PI, sine_cosine

LEFT, ACROSS, TOP, DOWN, INSET_ALONG, HIGHEST, LOWEST, DENSITY = range(8)
"""Columns of a block's record, 64 bytes. Vertical ones are cosines, or angles for "angles"."""
RECORD = 8
REST, POWER, DRAWN, ALONG, BELOW, X, Y, Z = (RUN * (RECORD + i) for i in range(8))
REAL_SIZE = RUN * (RECORD + 8)
"""Rows after those of the record: the rest of an exponent and its power of two, the law's x, the
place in the block, the direction."""
LOG2_E = 1.0 / math.log(2.0)
LN2_HIGH = 6.93147180369123816490e-01
"""ln 2 to 33 bits, so that its multiples are exact."""
LN2_LOW = 1.90821492927058770002e-10
POWERS = 2.0 ** np.arange(1024)
_C = tuple(1.0 / math.factorial(i + 1) for i in range(13))
"""(eʳ − 1)/r to 10⁻¹⁷ on |r| ≤ ln 2 / 2."""


@kernel
def _exponents(u, first, last, spread, whole, real):
    """ξ · spread = k ln 2 + rest, |rest| ≤ ln 2 / 2."""
    for k in range(RUN):
        i = min(first + k, last)
        t = np.float64(u[i, 0]) * spread
        power = math.floor(t * LOG2_E + 0.5)
        whole[k] = np.int32(power)
        real[REST + k] = (t - power * LN2_HIGH) - power * LN2_LOW
        real[BELOW + k], real[ALONG + k] = np.float64(u[i, 1]), np.float64(u[i, 2])


@kernel
def _powers(whole, real):
    for k in range(RUN):
        real[POWER + k] = POWERS[np.uint32(whole[k])]


@kernel
def _numbers(alpha, blocks, whole, real):
    """The law's x = α (e^(ξ · spread) − 1), exact for flat laws too, and the blocks' numbers."""
    for k in range(RUN):
        r = real[REST + k]
        p = _C[12]
        p = p * r + _C[11]
        p = p * r + _C[10]
        p = p * r + _C[9]
        p = p * r + _C[8]
        p = p * r + _C[7]
        p = p * r + _C[6]
        p = p * r + _C[5]
        p = p * r + _C[4]
        p = p * r + _C[3]
        p = p * r + _C[2]
        p = p * r + _C[1]
        p = p * r + _C[0]
        power = real[POWER + k]
        x = alpha * (power * (p * r) + (power - 1.0))
        real[DRAWN + k] = x
        whole[k] = max(min(np.int32(x), np.int32(blocks - 1)), np.int32(0))


@kernel
def _fetch(record, whole, real):
    for k in range(RUN):
        block = np.uint32(whole[k])
        for column in range(RECORD):
            real[column * RUN + k] = record[block, column]


@kernel
def _directions(real):
    for k in range(RUN):
        inset = real[INSET_ALONG * RUN + k]
        along = min(max(real[ALONG + k], inset), 1.0 - inset)
        turn = (real[LEFT * RUN + k] + along * real[ACROSS * RUN + k]) * (1.0 / TWO_PI)
        y = real[TOP * RUN + k] + real[BELOW + k] * real[DOWN * RUN + k]
        y = max(min(y, real[HIGHEST * RUN + k]), real[LOWEST * RUN + k])
        sine, cosine = sine_cosine(turn)
        sin_theta = math.sqrt((1.0 - y) * (1.0 + y))
        real[X + k], real[Y + k], real[Z + k] = sine * sin_theta, y, -cosine * sin_theta


@kernel
def _store(first, direction, pdf, real):
    for k in range(min(RUN, len(pdf) - first)):
        pdf[first + k] = real[DENSITY * RUN + k]
        direction[first + k, 0] = real[X + k]
        direction[first + k, 1] = real[Y + k]
        direction[first + k, 2] = real[Z + k]


@kernel
def sample_law(u, alpha, at_drawn_x, record, direction, pdf):
    """Directions (n, 3) and their density for numbers u (n, 3), uniform in a block's solid angle.

    record : (blocks, 8); at_drawn_x : the density is the law's at the x that was drawn
    """
    blocks, last = len(record), len(u) - 1
    spread = math.log1p(blocks / alpha)
    whole, real = np.zeros(RUN, np.int32), np.zeros(REAL_SIZE)
    for first in range(0, len(u), RUN):
        _exponents(u, first, last, spread, whole, real)
        _powers(whole, real)
        _numbers(alpha, blocks, whole, real)
        _fetch(record, whole, real)
        if at_drawn_x:
            for k in range(RUN):
                real[DENSITY * RUN + k] *= density_at(real[DRAWN + k], blocks, alpha)
        _directions(real)
        _store(first, direction, pdf, real)


@kernel
def _columns(u, first, last, blocks, whole, real):
    """The columns of the alias table, all alike in probability."""
    for k in range(RUN):
        i = min(first + k, last)
        whole[k] = min(np.int32(np.float64(u[i, 0]) * blocks), np.int32(blocks - 1))
        real[BELOW + k], real[ALONG + k] = np.float64(u[i, 1]), np.float64(u[i, 2])


@kernel
def _kept_or_alias(threshold, alias, whole, real):
    """Each column's own block or its alias; the number that decided is stretched and used again."""
    for k in range(RUN):
        column = np.uint32(whole[k])
        keep, along = threshold[column], real[ALONG + k]
        kept = along < keep
        whole[k] = whole[k] if kept else np.int32(alias[column])
        real[ALONG + k] = (along if kept else along - keep) / (keep if kept else 1.0 - keep)


@kernel
def sample_table(u, threshold, alias, record, direction, pdf):
    """As `sample_law`, with the blocks drawn by an alias table."""
    blocks, last = len(record), len(u) - 1
    whole, real = np.zeros(RUN, np.int32), np.zeros(REAL_SIZE)
    for first in range(0, len(u), RUN):
        _columns(u, first, last, blocks, whole, real)
        _kept_or_alias(threshold, alias, whole, real)
        _fetch(record, whole, real)
        _directions(real)
        _store(first, direction, pdf, real)


@kernel
def _walk(x, y, axis, child, share, number):
    """The block that a walk from the root ends in, and the numbers that are left within it."""
    node = 0
    while child[node] >= 0:
        first = share[node]
        value = y if axis[node] else x
        if value < first:
            value, node_next = value / first, child[node]
        else:
            value, node_next = (value - first) / (1.0 - first), child[node] + 1
        if axis[node]:
            y = value
        else:
            x = value
        node = node_next
    return number[node], x, y


@kernel
def sample_walk(u, axis, child, share, number, record, direction, pdf):
    """As `sample_law`, with the blocks found by a walk down the tree.

    share : (m,) of a node's energy that its first child has; number : (m,) of a leaf's record
    """
    last = len(u) - 1
    whole, real = np.zeros(RUN, np.int32), np.zeros(REAL_SIZE)
    for first in range(0, len(u), RUN):
        for k in range(RUN):
            i = min(first + k, last)
            whole[k], real[ALONG + k], real[BELOW + k] = _walk(
                np.float64(u[i, 0]), np.float64(u[i, 1]), axis, child, share, number
            )
        _fetch(record, whole, real)
        _directions(real)
        _store(first, direction, pdf, real)


@kernel
def _place_in_angles(record, along, down, out):
    """Write the direction at (along, down) in a block; returns the factor of its density."""
    inset = record[INSET_ALONG]
    phi = record[LEFT] + min(max(along, inset), 1.0 - inset) * record[ACROSS]
    theta = max(min(record[TOP] + down * record[DOWN], record[LOWEST]), record[HIGHEST])
    sin_theta = math.sin(theta)
    out[0] = math.sin(phi) * sin_theta
    out[1] = math.cos(theta)
    out[2] = -math.cos(phi) * sin_theta
    return 1.0 / sin_theta


@kernel
def sample_law_in_angles(u, alpha, at_drawn_x, record, direction, pdf):
    blocks = len(record)
    spread = math.log1p(blocks / alpha)
    for i in range(len(u)):
        x = alpha * math.expm1(np.float64(u[i, 0]) * spread)
        block = record[min(int(x), blocks - 1)]
        factor = _place_in_angles(block, np.float64(u[i, 2]), np.float64(u[i, 1]), direction[i])
        if at_drawn_x:
            factor *= density_at(x, blocks, alpha)
        pdf[i] = block[DENSITY] * factor


@kernel
def sample_table_in_angles(u, threshold, alias, record, direction, pdf):
    blocks = len(record)
    for i in range(len(u)):
        number = min(int(np.float64(u[i, 0]) * blocks), blocks - 1)
        along, keep = np.float64(u[i, 2]), threshold[number]
        if along < keep:
            along /= keep
        else:
            along = (along - keep) / (1.0 - keep)
            number = alias[number]
        block = record[number]
        factor = _place_in_angles(block, along, np.float64(u[i, 1]), direction[i])
        pdf[i] = block[DENSITY] * factor


@kernel
def sample_walk_in_angles(u, axis, child, share, number, record, direction, pdf):
    for i in range(len(u)):
        found, along, down = _walk(
            np.float64(u[i, 0]), np.float64(u[i, 1]), axis, child, share, number
        )
        pdf[i] = record[found][DENSITY] * _place_in_angles(record[found], along, down, direction[i])
