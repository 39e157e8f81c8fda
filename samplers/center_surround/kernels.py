"""Compiled passes of the centre-surround search: reduce a map, and sum filters over caps.

A cap meets a row of a latitude-longitude map in one interval of φ that is symmetric about its
centre, so its flux is a sum over rows of differences of the row's prefix sums, interpolated where
the interval ends within a pixel. Rows are cut into several sub-rows, each with its own interval, so
that the rim of a small cap is followed across a row as well.
"""

import math

import numpy as np

from samplers.compiled import kernel


@kernel
def reduce_rows(radiance, height, start, stop, out):
    """Luminous flux of rows start..stop of a grid of height × 2·height cells, exact at fractions.

    radiance : (H, 2H, 3)
    out : (height, 2·height) float64
    """
    rows, columns = radiance.shape[:2]
    line = np.empty(columns)
    ratio = rows / height
    for i in range(start, stop):
        line[:] = 0.0
        low, high = i * ratio, (i + 1) * ratio
        for r in range(math.floor(low), min(math.ceil(high), rows)):
            a = max(low, r) * math.pi / rows
            b = min(high, r + 1) * math.pi / rows
            weight = 2.0 * math.sin(0.5 * (a + b)) * math.sin(0.5 * (b - a)) * (math.pi / rows)
            for c in range(columns):
                line[c] += weight * (
                    0.2126 * radiance[r, c, 0]
                    + 0.7152 * radiance[r, c, 1]
                    + 0.0722 * radiance[r, c, 2]
                )
        for j in range(2 * height):
            left, right = j * ratio, (j + 1) * ratio
            total = 0.0
            for c in range(math.floor(left), min(math.ceil(right), columns)):
                total += line[c] * (min(right, c + 1) - max(left, c))
            out[i, j] = total


@kernel
def prefix_rows(flux, start, stop, out):
    """Prefix sums of rows start..stop over three turns, (h, 3w + 1); column w is φ = 0."""
    width = flux.shape[1]
    for i in range(start, stop):
        total = 0.0
        out[i, 0] = 0.0
        for k in range(3 * width):
            total += flux[i, k % width]
            out[i, k + 1] = total


@kernel
def _prefix_at(prefix, row, t):
    k = math.floor(t)
    below = prefix[row, k]
    return below + (t - k) * (prefix[row, k + 1] - below)


@kernel
def respond(
    prefix, share, half_width, first, cap_weight, cap_filter, filters, pixel, start, stop,
    response, size,
):  # fmt: skip
    """The largest response over all filters, and its filter, at the pixels number start..stop.

    prefix : (h, 3w + 1)
    share : (h, parts) of a row's solid angle in each of its sub-rows
    half_width : (h, caps, k) half the interval's length in columns, for a centre in row i, in the
        sub-row first[i] + k; negative where the cap does not reach it
    pixel : (n,) flat indices; response, size : flat over the map, out
    """
    width = (prefix.shape[1] - 1) // 3
    parts = share.shape[1]
    sums = np.empty(filters)
    for n in range(start, stop):
        i, j = pixel[n] // width, pixel[n] % width
        middle = width + j + 0.5
        sums[:] = 0.0
        for cap in range(len(cap_weight)):
            flux = 0.0
            for k in range(half_width.shape[2]):
                reach = half_width[i, cap, k]
                if reach < 0.0:
                    continue
                row, part = divmod(first[i] + k, parts)
                inside = _prefix_at(prefix, row, middle + reach)
                inside -= _prefix_at(prefix, row, middle - reach)
                flux += share[row, part] * inside
            sums[cap_filter[cap]] += cap_weight[cap] * flux
        best = np.argmax(sums)
        response[pixel[n]], size[pixel[n]] = sums[best], best
