"""kd-tree importance sampling: a block drawn without a search, then a direction inside it.

The map is cut into blocks of little variation. Sorted by falling probability, the blocks follow a
law of one parameter whose inverse is a formula, so a sample costs one read of a block's bounds,
whatever the map. The renderer draws half of the samples from the BRDF and weights both techniques
by the power heuristic.

Source: Ergun, Kurt and Öztürk, "Real-time kd-tree based importance sampling of environment maps",
Spring Conference on Computer Graphics 2012: the tree, algorithms 1–3; the law and its fit,
equations 4–8; sampling, section 3.3.

Built once in O(blocks × (width + height)); a sample is O(1), and so is the density of a given
direction, by a label map of 2 bytes a pixel, which generation does not read. Unbiased; noisier than
an exact table where the law does not follow the map, since the ratio of radiance to density then
varies. The blocks are tied to the seam, so a map turned about the vertical axis has another tree.

Settled here, where the paper is silent or biased: blocks are sorted by their sum, since only then
are their probabilities falling; blocks without energy are never drawn; a density is the exact
probability of the block over its solid angle.

Parameters
    blocks : 6144 (default), what the paper fits into its constant memory
    selection : the next block to split has the largest "sse" (default, the paper's best),
        "variance" or "range"
    weighting : "solid-angle" (default) or, as published, all "pixels" alike
    pdf_form : "exact-mass" (default); "paper-continuous" is the law at the x that was drawn, which
        is unbiased but noisy, and which a given direction does not have (`pdf` then answers with
        the mean over the block); "paper-integer" is the law at the block's number, which is biased.
        Two controls do without the law and draw blocks by their true probabilities: "exact" by an
        alias table, "walk" by a walk down the tree, which keeps the stratification of the numbers
        that sorting destroys
    placement : uniform in "solid-angle" (default) or, as published, in the two "angles"
    numbers : "low-discrepancy" (default) or "independent", as the paper's are; measured, as every
        open choice, by the experiment `readings`
"""

import math
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler, Reading, register
from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.tabulated import INSET, UniformDistribution
from samplers.kd_tree.build import KdTree, Selection, Weighting, build_kd_tree
from samplers.kd_tree.fit import alias_table, densities, fit_alpha, masses
from samplers.kd_tree.sample import (
    ACROSS,
    DENSITY,
    DOWN,
    HIGHEST,
    INSET_ALONG,
    LEFT,
    LOWEST,
    TOP,
    sample_law,
    sample_law_in_angles,
    sample_table,
    sample_table_in_angles,
    sample_walk,
    sample_walk_in_angles,
)
from samplers.lighting import LightDistribution
from samplers.reference import Reference
from samplers.sphere import pixels_of

PdfForm = Literal["exact-mass", "paper-continuous", "paper-integer", "exact", "walk"]
Placement = Literal["solid-angle", "angles"]
Numbers = Literal["low-discrepancy", "independent"]

BY_LAW = "its paper draws the block's number by the fitted law"
BYTES_PER_BLOCK = 8
"""Four bounds of 16 bits each, which is what sampling needs of a block."""


@kernel
def _pdf(direction, label, density, angles, pdf):
    row, column = np.empty(len(pdf), np.int32), np.empty(len(pdf), np.int32)
    pixels_of(direction, len(label), row, column)
    for i in range(len(pdf)):
        pdf[i] = density[label[row[i], column[i]]]
        if angles and pdf[i] > 0.0:
            pdf[i] /= math.sqrt(direction[i, 0] ** 2 + direction[i, 2] ** 2)


def _records(block: NDArray, mass: NDArray, height: int, angles: bool) -> NDArray[np.float64]:
    """What sampling reads of each block (n, 8): bounds, how near its edges it goes, density."""
    step = math.pi / height
    top, left, bottom, right = (block[:, k].astype(np.float64) for k in range(4))
    record = np.empty((len(block), 8))
    record[:, LEFT], record[:, ACROSS] = left * step, (right - left) * step
    record[:, INSET_ALONG] = INSET / (right - left)
    # Cosines of a thin block differ by the product of two sines, which loses no digits.
    thickness = 2.0 * np.sin(0.5 * (top + bottom) * step) * np.sin(0.5 * (bottom - top) * step)
    theta = [top * step, (top + INSET) * step, (bottom - INSET) * step]
    record[:, TOP], record[:, HIGHEST], record[:, LOWEST] = theta if angles else np.cos(theta)
    record[:, DOWN] = (bottom - top) * step if angles else -thickness
    record[:, DENSITY] = mass / (record[:, ACROSS] * np.abs(record[:, DOWN]))
    return record


@dataclass(frozen=True, eq=False, repr=False)
class KdTreeDistribution:
    """Blocks of a map, drawn by a law of one parameter, and a map that finds them again.

    record : (n, 8) float64, the blocks that are ever drawn, by falling probability
    probability : (n,) float64, their share of the map's energy
    label : (H, W) uint16 or uint32, the block of each pixel, numbered as the tree's leaves are
    density : (leaves,) float64, 0 where a block is never drawn
    alpha, residual : the law's parameter and the L1 distance Σ |p̃ − law| that is left
    threshold, alias : the alias table; without entries where it is not used
    share, number : what a walk reads of each node, the first child's part of the energy and the
        record of a leaf; without entries where it is not used
    """

    tree: KdTree
    record: NDArray[np.float64]
    probability: NDArray[np.float64]
    label: NDArray[np.unsignedinteger]
    density: NDArray[np.float64]
    alpha: float
    residual: float
    threshold: NDArray[np.float64]
    alias: NDArray[np.int64]
    share: NDArray[np.float64]
    number: NDArray[np.int64]
    at_drawn_x: bool
    angles: bool
    count: int
    independent: bool

    @property
    def compression_ratio(self) -> float:
        """Bytes of the map as one float32 channel over bytes of the blocks' bounds."""
        height, width = self.tree.bounds[0, 2:]
        return 4.0 * float(height) * float(width) / (BYTES_PER_BLOCK * len(self.tree.leaf))

    @property
    def nbytes(self) -> int:
        """Bytes that sampling and the density of given directions read."""
        tables = (self.record, self.label, self.density, self.threshold, self.alias, self.share,
                  self.number)  # fmt: skip
        walked = (self.tree.axis, self.tree.child) if len(self.share) else ()
        return sum(table.nbytes for table in (*tables, *walked))

    def sample(self, u: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        direction, pdf = np.empty((len(u), 3), np.float32), np.empty(len(u), np.float32)
        if len(self.threshold):
            by_table = sample_table_in_angles if self.angles else sample_table
            by_table(u, self.threshold, self.alias, self.record, direction, pdf)
        elif len(self.share):
            by_walk = sample_walk_in_angles if self.angles else sample_walk
            by_walk(
                u, self.tree.axis, self.tree.child, self.share, self.number, self.record,
                direction, pdf,
            )  # fmt: skip
        else:
            by_law = sample_law_in_angles if self.angles else sample_law
            by_law(u, self.alpha, self.at_drawn_x, self.record, direction, pdf)
        return direction, pdf

    def pdf(self, direction: NDArray[np.float32]) -> NDArray[np.float32]:
        pdf = np.empty(len(direction), np.float32)
        _pdf(direction, self.label, self.density, self.angles, pdf)
        return pdf


@register("kd-tree")
@dataclass(frozen=True)
class KdTreeImportance(LightSampler):
    """Blocks of a kd-tree drawn by a law with a closed inverse, and BRDF sampling."""

    label: ClassVar[str] = "kd-tree (Ergun 2012)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Serkan Ergun, Murat Kurt, Aydın Öztürk",
            "Real-time kd-tree based importance sampling of environment maps",
            "Spring Conference on Computer Graphics",
            2012,
            doi="10.1145/2448531.2448541",
        ),
    )
    stochastic: ClassVar[bool] = True

    blocks: int = field(default=6144, metadata={"fixed": "its paper prints the value"})
    selection: Selection = "sse"
    weighting: Weighting = "solid-angle"
    pdf_form: PdfForm = "exact-mass"
    placement: Placement = "solid-angle"
    numbers: Numbers = "low-discrepancy"

    readings = (
        Reading("blocks split by squared error", {"selection": "sse"}),
        Reading(
            "blocks split by variance",
            {"selection": "variance"},
            "its paper prefers the squared error",
        ),
        Reading(
            "blocks split by range", {"selection": "range"}, "its paper prefers the squared error"
        ),
        Reading("pixels weighted by solid angle", {"weighting": "solid-angle"}),
        Reading("pixels weighted alike", {"weighting": "pixels"}),
        Reading("density by the block's exact mass", {"pdf_form": "exact-mass"}),
        Reading("density by the law where it was drawn", {"pdf_form": "paper-continuous"}),
        Reading("density by the law at the block's number", {"pdf_form": "paper-integer"}),
        Reading("blocks drawn by an alias table", {"pdf_form": "exact"}, BY_LAW),
        Reading("blocks drawn by a walk down the tree", {"pdf_form": "walk"}, BY_LAW),
        Reading("uniform in solid angle within a block", {"placement": "solid-angle"}),
        Reading("uniform in angles within a block", {"placement": "angles"}),
        Reading("low-discrepancy numbers", {"numbers": "low-discrepancy"}),
        Reading("independent numbers", {"numbers": "independent"}),
    )
    costly = ("pdf_form",)

    def __post_init__(self) -> None:
        if self.blocks < 1:
            raise EnvlightError(f"kd-tree: {self.blocks} blocks; at least 1 is needed")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> LightDistribution:
        if environment.is_black:
            return UniformDistribution(count)
        tree = build_kd_tree(environment, self.blocks, self.selection, self.weighting)
        order = np.argsort(-tree.total, kind="stable")
        order = order[tree.total[order] > 0.0]
        probability = tree.total[order] / tree.total[order].sum()
        n, angles = len(order), self.placement == "angles"
        alpha, residual = fit_alpha(probability, self.pdf_form.startswith("paper"))
        mass = probability if self.pdf_form in ("exact", "walk") else masses(n, alpha)
        if self.pdf_form == "paper-integer":
            mass = densities(n, alpha)
        record = _records(tree.block[order], mass, environment.height, angles)
        density = np.zeros(len(tree.leaf))
        density[order] = record[:, DENSITY]
        at_drawn_x = self.pdf_form == "paper-continuous"
        if at_drawn_x:
            record[:, DENSITY] /= mass
        threshold, alias = np.empty(0), np.empty(0, np.int64)
        share, number = np.empty(0), np.empty(0, np.int64)
        if self.pdf_form == "exact":
            threshold, alias = alias_table(probability)
        if self.pdf_form == "walk":
            share, number = _walked(tree, order)
        leaves = np.arange(len(tree.leaf))
        label = tree.painted(leaves.astype(np.uint16 if len(leaves) <= 1 << 16 else np.uint32))
        return KdTreeDistribution(
            tree, record, probability, label, density, alpha, residual, threshold, alias, share,
            number, at_drawn_x, angles, count, self.numbers == "independent",
        )  # fmt: skip


def _walked(
    tree: KdTree, order: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The first child's share of each node's energy, and the record of each leaf that is drawn."""
    total, inner = tree.node_total, np.flatnonzero(tree.child >= 0)
    share, number = np.zeros(len(total)), np.zeros(len(total), np.int64)
    part = total[tree.child[inner]]
    share[inner] = np.divide(part, total[inner], out=np.zeros(len(inner)), where=part > 0.0)
    number[tree.leaf[order]] = np.arange(len(order))
    return share, number
