"""How well a kd-tree's blocks, and the law that draws them, follow a map.

Sizes and fits of Ergun, Kurt and Öztürk, "Real-time kd-tree based importance sampling of
environment maps", SCCG 2012: compression (section 4), the criterion by which blocks are chosen for
a split (Figure 1), empirical and fitted probabilities (Figure 2). Errors are integrals over solid
angle; p is the map's density, luminance over its integral, and q another one.

unexplained : ∫ (L − mean of the block)² over ∫ (L − mean of the map)²
psnr_shown : of the map of block means, as a grey picture of 8 bits at an automatic exposure
distance : ½ ∫ |p − q|, by the blocks' means and by the law's density
variance : ∫ p² / q − 1, the relative variance of one sample's estimate of the map's energy
"""

import json
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.report.preview import automatic_exposure, encoded
from experiments.report.sheets import keep_tile, tile_path
from experiments.run.experiment import Row
from metrics.errors import psnr
from samplers import EnvironmentMap, EnvlightError, make_sampler
from samplers.kd_tree import KdTreeDistribution
from samplers.kd_tree.fit import masses

CURVE = "curve"
CURVE_POINTS = 60
PICTURE_WIDTH = 640
SHOWN_STOPS = 3.0
"""Ratios of the law's density to the map's are shown between 2⁻³ and 2³."""

Array = NDArray[np.float64]


def blocks_of(
    environment: EnvironmentMap, blocks: int, selection: str, weighting: str
) -> KdTreeDistribution:
    """The kd-tree sampler's distribution; EnvlightError for a black map, which has none."""
    sampler = make_sampler("kd-tree", blocks=blocks, selection=selection, weighting=weighting)
    made = sampler.prepare(environment, 1, np.random.default_rng(0))
    if not isinstance(made, KdTreeDistribution):
        raise EnvlightError(f"map '{environment.name}' is black: it has no blocks to fit")
    return made


def block_means(environment: EnvironmentMap, made: KdTreeDistribution) -> Array:
    """The map (H, W) of each block's mean luminance over solid angle."""
    label = made.label.ravel()
    solid_angle = np.repeat(environment.row_solid_angle, environment.width)
    flux = np.bincount(label, environment.flux.ravel())
    mean = flux / np.bincount(label, solid_angle)
    return np.asarray(mean[label].reshape(environment.luminance.shape))


def law_density(made: KdTreeDistribution) -> Array:
    """The density (H, W) in sr⁻¹ with which the law draws directions, at pixels' centres."""
    return np.asarray(made.density[made.label])


def fit_row(environment: EnvironmentMap, made: KdTreeDistribution) -> Row:
    """Size and errors of the blocks and of the law."""
    luminance = environment.luminance.astype(np.float64)
    weight = environment.row_solid_angle[:, None]
    total = environment.flux.sum()
    means, mean = block_means(environment, made), total / (4.0 * math.pi)
    varies = float((weight * (luminance - mean) ** 2).sum())
    left = float((weight * (luminance - means) ** 2).sum())
    p = luminance / total
    by_blocks, by_law = means / total, law_density(made)
    return {
        "drawn": len(made.record),
        "compression": made.compression_ratio,
        "unexplained": left / varies if varies > 1e-12 * mean * total else 0.0,
        "psnr_shown": psnr(grey(means, luminance), grey(luminance, luminance)),
        "distance_blocks": float(0.5 * (weight * np.abs(p - by_blocks)).sum()),
        "distance_law": float(0.5 * (weight * np.abs(p - by_law)).sum()),
        "variance_blocks": _variance(p, by_blocks, weight),
        "variance_law": _variance(p, by_law, weight),
        "alpha": made.alpha,
        "residual": made.residual,
        CURVE: json.dumps(law_curve(made)),
    }


def _variance(p: Array, q: Array, weight: Array) -> float:
    """∫ p² / q − 1 where p is; infinite where q leaves some of it out."""
    lit = p > 0.0
    if (q[lit] <= 0.0).any():
        return math.inf
    ratio = np.divide(p, q, out=np.zeros_like(p), where=lit)
    return max(0.0, float((weight * p * ratio).sum()) - 1.0)


def law_curve(made: KdTreeDistribution) -> list[list[float]]:
    """Block number from 1, empirical probability and the law's, at some blocks evenly in log."""
    count = len(made.record)
    number = np.unique(np.geomspace(1, count, CURVE_POINTS).round().astype(int))
    law = masses(count, made.alpha)
    return [[int(n), float(made.probability[n - 1]), float(law[n - 1])] for n in number]


def grey(luminance: Array, exposed_by: Array) -> NDArray[np.float32]:
    """A luminance map (H, W) as an exposed grey image (H, W, 3)."""
    level = 2.0 ** automatic_exposure(np.repeat(exposed_by[:, :, None], 3, axis=2))
    return np.repeat((luminance * level).astype(np.float32)[:, :, None], 3, axis=2)


def keep_pictures(
    folder: Path, environment: EnvironmentMap, made: KdTreeDistribution, selection: str
) -> None:
    """The map of block means; for "sse" also the map itself, the law's density and its error."""
    luminance = environment.luminance.astype(np.float64)
    name = environment.name
    _keep(tile_path(folder, name, selection), grey(block_means(environment, made), luminance))
    if selection == "sse":
        drawn = law_density(made) * environment.flux.sum()
        _keep(tile_path(folder, name, "map"), grey(luminance, luminance))
        _keep(tile_path(folder, name, "law"), grey(drawn, luminance))
        _keep(tile_path(folder, name, "error"), ratio_picture(drawn, luminance))


def ratio_picture(drawn: Array, luminance: Array) -> NDArray[np.float32]:
    """Red where the law draws too often, blue where too seldom, white where right.

    drawn : (H, W) the law's density times the map's energy, which should be its luminance

    Full colour is a factor of 8; what is dark and never drawn is black.
    """
    ratio = np.log2(np.maximum(drawn, 1e-30) / np.maximum(luminance, 1e-30)) / SHOWN_STOPS
    amount = np.clip(ratio, -1.0, 1.0)
    out = np.ones((*amount.shape, 3))
    out[..., 1:] -= 0.85 * np.maximum(amount, 0.0)[..., None]
    out[..., :2] -= 0.85 * np.maximum(-amount, 0.0)[..., None]
    out[(drawn <= 0.0) & (luminance <= 0.0)] = 0.0
    return out.astype(np.float32)


def _keep(path: Path, image: NDArray[np.float32]) -> None:
    """Keep an exposed image as a tile, reduced to about 640 texels across."""
    from PIL import Image

    factor = max(1, image.shape[1] // PICTURE_WIDTH)
    keep_tile(path, np.array(Image.fromarray(encoded(image)).reduce(factor)))
