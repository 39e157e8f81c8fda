"""Spherical Q²-tree: a forest of equal-area quads, split where light is, mended frame by frame.

The sphere is cut into the 12 quads of HEALPix. The most important leaf is split into its four
quarters, all of the same solid angle, until the budget is met, and every leaf gives one light with
the leaf's integral of radiance. Importance is Γ = L Δω^¼ with L the luminance collected by a quad
and Δω its solid angle, so bright quads are split first and wide ones are not forgotten.

Γ of a quad depends on nothing outside it, so a local change of the map changes the lights locally.
The tree of one frame is mended into that of the next: the least important split quads are merged
and the most important leaves split, until none of the former is less important than one of the
latter. Run to the end, that is the tree built from scratch; stopped early, it trades fidelity for
calm.

Source: Wan, Wong and Leung, "Spherical Q²-tree for sampling dynamic environment sequences", EGSR
2005, sections 3–5; importance from Agarwal et al., "Structured importance sampling of environment
maps", SIGGRAPH 2003, without its clamp of small solid angles.

L is a sum over the rows of the map (see `samplers.grids.quad_map`) in place of the paper's map
resampled to a grid with a summed-area table: as exact as the map, and only for the quads that are
asked for. Building costs one pass over the map and about four sums per light. The lights are a
fixed quadrature: noise-free and biased; their energy is exact. Every split adds three lights: a
budget N gives 12 + 3⌊(N − 12)/3⌋ of them, never more than N, and fewer where splits end at the size
of a texel or at quads without light. A turn of the map by a quarter turns the lights.

Parameters
    power : ¼ (default), the exponent of Δω
    position : "centroid" (default) is the energy centroid of the quad; "centre" is its middle;
        "jitter" moves a light from the middle by up to a quarter of the quad's side, by a
        low-discrepancy sequence over the quads. The paper jitters "around the centroid" and gives
        neither the centroid's weights nor the amount.
    light_extent : how far a light's cluster reaches, by which interleaved sampling perturbs it:
        "mean", "largest" or "full", the same for all samplers (`samplers.lighting`)
    sets : "perturbed" (default) or "independent", eight sets of its own
        (`samplers.independent_sets`)

`experiments.questions.readings` compares them.
"""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler, Reading, register
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.healpix_grid import nested_index
from samplers.grids.healpix_quads import quad_extent, quad_points
from samplers.grids.quad_map import QuadMap
from samplers.lighting import LIGHT_EXTENT, DirectionalLights, LightExtent, Sets
from samplers.q2_tree.forest import BASE, Quad, QuadForest
from samplers.reference import Reference
from samplers.sphere import normalized

Position = Literal["jitter", "centre", "centroid"]

JITTER = 0.5
"""Width of the jitter in sides of a quad: up to a quarter to either side."""
PLASTIC = 1.32471795724474602596
"""Root of x³ = x + 1: its powers make the R2 low-discrepancy sequence."""


@dataclass(frozen=True, eq=False)
class Q2Tree:
    """The quads of one map, from which those of the next are found.

    split : the quads that are split, leaves : those that are not, (level, face, i, j), in the
        order of the nested numbering
    flux : (n, 3) float64, ∫ L dω over each leaf
    """

    source: QuadMap
    count: int
    power: float
    split: tuple[Quad, ...]
    leaves: tuple[Quad, ...]
    flux: NDArray[np.float64]

    @classmethod
    def build(cls, environment: EnvironmentMap, count: int, power: float = 0.25) -> "Q2Tree":
        """The tree of `environment` with at most `count` leaves, at least 12."""
        return cls.grown(QuadMap.of(environment), count, power)

    def update(self, environment: EnvironmentMap, tolerance: float = 0.0) -> "Q2Tree":
        """The tree of the next map of the same size, found by mending this one; see `mended`."""
        return self.mended(QuadMap.of(environment), tolerance)

    @classmethod
    def grown(cls, source: QuadMap, count: int, power: float = 0.25) -> "Q2Tree":
        """The tree of a map that has been read: this is the tree's part of `build`."""
        return cls._settled(QuadForest(source, power, [], BASE), count, 0.0)

    def mended(self, source: QuadMap, tolerance: float = 0.0) -> "Q2Tree":
        """The next tree, of a map that has been read: this is the tree's part of `update`.

        tolerance : stop when the first leaf is more important than the last split quad by no more
            than this share of its importance; 0 gives the tree built from scratch
        """
        if source.environment.height != self.source.environment.height:
            raise EnvlightError(
                f"q2-tree: a map of {source.environment.height} rows after one of "
                f"{self.source.environment.height}; build a new tree"
            )
        if not tolerance >= 0.0:
            raise EnvlightError(f"q2-tree: tolerance {tolerance}; it must not be negative")
        forest = QuadForest(source, self.power, list(self.split), list(self.leaves))
        return self._settled(forest, self.count, tolerance)

    @classmethod
    def _settled(cls, forest: QuadForest, count: int, tolerance: float) -> "Q2Tree":
        forest.settle((count - len(BASE)) // 3, tolerance)
        deepest = forest.source.deepest_level

        def place(quad: Quad) -> tuple[int, int, int]:
            level, face, i, j = quad
            side = 1 << deepest
            return (
                face,
                nested_index(0, i << (deepest - level), j << (deepest - level), side),
                level,
            )

        leaves = tuple(sorted(forest.leaves, key=place))
        flux = np.array([forest.flux[quad] for quad in leaves])
        split = tuple(sorted(forest.split, key=place))
        return cls(forest.source, count, forest.power, split, leaves, flux)

    def lights(
        self, position: Position = "centroid", light_extent: LightExtent = LIGHT_EXTENT
    ) -> DirectionalLights:
        """One light for each leaf that holds light."""
        lit = self.flux.any(axis=1)
        if not lit.any():
            return DirectionalLights.none()
        quad, flux = np.array(self.leaves, np.int64)[lit], self.flux[lit]
        direction = quad_points(
            quad, _jitter(quad) if position == "jitter" else np.zeros(quad.shape)
        )
        if position == "centroid":
            direction = normalized(self.source.moments(quad), direction)
        return DirectionalLights(direction, flux, quad_extent(quad, direction, light_extent))


def _jitter(quad: NDArray[np.int64]) -> NDArray[np.float64]:
    """Offsets (n, 2) from the quads' centres in sides, the same in every face."""
    number = np.array(
        [
            (4**level - 1) // 3 + nested_index(0, i, j, 1 << level)
            for level, _, i, j in quad.tolist()
        ]
    )
    step = np.array([1.0 / PLASTIC, 1.0 / PLASTIC**2])
    return JITTER * ((0.5 + number[:, None] * step) % 1.0 - 0.5)


@register("q2-tree")
@dataclass(frozen=True)
class SphericalQ2Tree(LightSampler):
    """A forest of HEALPix quads, split by importance (Q²-tree)."""

    label: ClassVar[str] = "Q²-tree (Wan 2005)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Liang Wan, Tien-Tsin Wong, Chi-Sing Leung",
            "Spherical Q2-tree for sampling dynamic environment sequences",
            "Eurographics Symposium on Rendering",
            2005,
            doi="10.2312/EGWR/EGSR05/021-030",
        ),
    )
    minimum_count: ClassVar[int] = len(BASE)

    power: float = field(default=0.25, metadata={"fixed": "its paper prints the value"})
    position: Position = "centroid"
    light_extent: LightExtent = LIGHT_EXTENT
    sets: Sets = "perturbed"

    readings = (
        Reading("lights at the energy centroid", {"position": "centroid"}),
        Reading("lights at the middle", {"position": "centre"}),
        Reading("lights jittered", {"position": "jitter"}),
    )

    def __post_init__(self) -> None:
        if not 0.0 < self.power <= 16.0:
            raise EnvlightError(f"q2-tree: power {self.power}; use a value in (0, 16]")
        if self.position not in ("jitter", "centre", "centroid"):
            raise EnvlightError("q2-tree: position is 'jitter', 'centre' or 'centroid'")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DirectionalLights:
        if environment.is_black:
            return DirectionalLights.none()
        tree = Q2Tree.build(environment, count, self.power)
        return tree.lights(self.position, self.light_extent)
