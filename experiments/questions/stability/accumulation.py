"""What the tables of a map lose when they are summed in single precision.

Summed-area tables and cumulative distributions add millions of texels, a sun among them. In float32
a running sum that is 2²⁴ times a texel no longer notices it: the texel's probability is 0, it is
never sampled, and regions of the map that lie behind the sun in the order of summation are known
only to the precision of the sun. This measures both precisions by the same code.
"""

import numpy as np
from numpy.typing import DTypeLike, NDArray

from experiments.questions.stability.brute_force import PLATES, texel_solid_angle
from samplers import DirectionalLights, make_sampler
from samplers.environment import EnvironmentMap

REGIONS = 4096
SIDE = 1 / 32
"""Height of a region as a share of the map's."""
LIGHTS = 4096
Figures = dict[str, float | int | str | None]


def accumulate(environment: EnvironmentMap, precision: str) -> Figures:
    """What sums of a map's flux in "float32" or "float64" make of it.

    total_error : of the total flux, summed texel after texel
    table_error : of the last entry of a summed-area table
    region_error : median over random regions of 1/32 of the map's height and width
    region_worst : the largest of them
    lost_flat, lost_rows : share of the lit texels whose probability becomes 0, in one cumulative
        distribution over all texels and in one per row under one over the rows
    bias_flat, bias_rows : total variation distance of the sampled from the true probabilities
    shading_error : of the irradiance on six plates by 4096 lights, added one after another
    """
    flux = environment.luminance * texel_solid_angle(environment.height).astype(np.float64)[:, None]
    total = float(flux.sum(dtype=np.longdouble))
    running = np.cumsum(flux.astype(precision).reshape(-1), dtype=precision)
    flat = np.diff(running.astype(np.float64), prepend=0.0)
    lost_flat, bias_flat = _compared(flat / float(running[-1]), flux.reshape(-1) / total)
    result: Figures = {
        "total_error": abs(float(running[-1]) / total - 1.0),
        "lost_flat": lost_flat,
        "bias_flat": bias_flat,
    }
    del running, flat
    result |= _by_rows(flux, total, precision) | _regions(flux, total, precision)
    result["shading_error"] = _shading(environment, precision)
    return result


def _compared(found: NDArray[np.float64], truth: NDArray[np.float64]) -> tuple[float, float]:
    """Share of the lit texels of probability 0, and ½ Σ |found − truth|."""
    lit = truth > 0.0
    lost = float(((found <= 0.0) & lit).sum() / max(int(lit.sum()), 1))
    return lost, 0.5 * float(np.abs(found - truth).sum())


def _by_rows(flux: NDArray[np.float64], total: float, precision: DTypeLike) -> Figures:
    """A distribution per row, and one over the rows."""
    running = np.cumsum(flux.astype(precision), axis=1, dtype=precision)
    marginal = np.cumsum(running[:, -1], dtype=precision).astype(np.float64)
    row_share = np.diff(marginal, prepend=0.0) / marginal[-1]
    last = running[:, -1:].astype(np.float64)
    share = np.diff(running.astype(np.float64), axis=1, prepend=0.0)
    share *= row_share[:, None] / np.where(last > 0.0, last, 1.0)
    lost, bias = _compared(share, flux / total)
    return {"lost_rows": lost, "bias_rows": bias}


def _regions(flux: NDArray[np.float64], total: float, precision: DTypeLike) -> Figures:
    height, width = flux.shape
    table = np.zeros((height + 1, width + 1), precision)
    np.cumsum(flux.astype(precision), axis=1, dtype=precision, out=table[1:, 1:])
    np.cumsum(table, axis=0, dtype=precision, out=table)
    size = max(1, round(SIDE * height))
    rng = np.random.default_rng(4)
    top = rng.integers(0, height - size + 1, REGIONS)
    left = rng.integers(0, width - 2 * size + 1, REGIONS)
    bottom, right = top + size, left + 2 * size
    found = (table[bottom, right] - table[top, right]) - (table[bottom, left] - table[top, left])
    truth = np.array(
        [flux[a:c, b:d].sum() for a, b, c, d in zip(top, left, bottom, right, strict=True)]
    )
    error = np.abs(found.astype(np.float64) / truth - 1.0)
    return {
        "table_error": abs(float(table[-1, -1]) / total - 1.0),
        "region_error": float(np.median(error)),
        "region_worst": float(error.max()),
    }


def _shading(environment: EnvironmentMap, precision: str) -> float:
    lights = make_sampler("median-cut").prepare(environment, LIGHTS, np.random.default_rng(0))
    assert isinstance(lights, DirectionalLights)
    cosine = np.maximum(lights.direction @ PLATES.T, 0.0)
    parts = cosine[:, :, None] * lights.irradiance[:, None]
    truth = parts.sum(axis=0, dtype=np.longdouble).astype(np.float64)
    found = np.cumsum(parts.astype(precision), axis=0, dtype=precision)[-1].astype(np.float64)
    return float((np.abs(found - truth)[truth > 0.0] / truth[truth > 0.0]).max(initial=0.0))
