"""LightGen: k-means of the map's pixels, weighted by their light.

The pixels of a small copy of the map are clustered by direction, each weighing as much as its
luminous flux. A cluster becomes a light at its energy centroid with its integral of radiance. The
clustering is run from several random starts and the one with the least weighted sum of squared
distances is kept. Nothing in it separates a small sun from the sky around it unless a start falls
on it, so small sources are missed with few lights.

Source: Cohen and Debevec, "LightGen", a plug-in for HDR Shop, 2001; its page names the resolution,
128 × 64, and that more is pointless, the number of searches (5) and of steps in each (100).
Distances are chords, so seam and poles need no care. The clustering itself is scikit-learn's.

The copy keeps the flux of every pixel, so the lights carry the map's energy exactly. Their number
is exact, but where fewer cells of the copy are lit. Cost: searches × steps × 8192 × lights. The
seed draws the starts. The lights are a fixed quadrature: noise-free and biased.

Parameters
    start : how a search begins: "random" (default) at pixels drawn in proportion to their light, or
        by "k-means++", which came later, at ones that are far from each other as well.
    searches : 5
    light_extent : how far a light's cluster reaches, by which interleaved sampling perturbs it:
        "mean", "largest" or "full", the same for all samplers (`samplers.lighting`)
    sets : "perturbed" (default) or "independent", eight sets of its own
        (`samplers.independent_sets`)

`experiments.questions.readings` compares them.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler, Reading, register
from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.light_leaves import lights_of_leaves
from samplers.grids.reduced_map import reduce_map
from samplers.lighting import LIGHT_EXTENT, DirectionalLights, LightExtent, Sets
from samplers.reference import Reference

ROWS = 64
"""Rows of the copy of the map that is clustered."""
STEPS = 100
"""Steps of a search, at most."""


def clusters(
    direction: NDArray[np.float64],
    weight: NDArray[np.float64],
    count: int,
    start: str,
    searches: int,
    seed: int,
) -> NDArray[np.int64]:
    """Labels (n,) from 0 of `count` clusters of the directions (n, 3), n ≥ count, or of fewer."""
    from sklearn.cluster import KMeans
    from threadpoolctl import threadpool_limits

    if count == len(direction):
        return np.arange(count)
    search = KMeans(count, init=start, n_init=searches, max_iter=STEPS, tol=0.0, random_state=seed)
    with threadpool_limits(1):  # or sums would depend on the number of threads
        label = search.fit_predict(direction, sample_weight=weight)
    return np.unique(label, return_inverse=True)[1]


@register("lightgen")
@dataclass(frozen=True)
class LightGen(LightSampler):
    """Lights at the means of clusters of pixels (LightGen)."""

    label: ClassVar[str] = "LightGen (Cohen 2001)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Jonathan Cohen, Paul Debevec",
            "LightGen, a plug-in for HDR Shop",
            "USC Institute for Creative Technologies",
            2001,
            kind="misc",
        ),
    )
    stochastic: ClassVar[bool] = True

    start: Literal["random", "k-means++"] = "random"
    searches: int = 5
    light_extent: LightExtent = LIGHT_EXTENT
    sets: Sets = "perturbed"

    readings = (
        Reading("searches begin by light", {"start": "random"}),
        Reading("searches begin by k-means++", {"start": "k-means++"}),
        Reading("best of five searches", {"searches": 5}),
        Reading("one search", {"searches": 1}),
    )

    def __post_init__(self) -> None:
        if self.start not in ("random", "k-means++"):
            raise EnvlightError(f"lightgen: start is 'random' or 'k-means++', not {self.start!r}")
        if self.searches < 1:
            raise EnvlightError(f"lightgen: searches is {self.searches}; use at least 1")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DirectionalLights:
        seed = int(rng.integers(1 << 31))
        if environment.is_black:
            return DirectionalLights.none()
        leaves, _ = reduce_map(environment, ROWS).leaves()
        weight = leaves.luminous_flux / leaves.luminous_flux.max()
        label = clusters(
            leaves.direction, weight, min(count, len(leaves)), self.start, self.searches, seed
        )
        return lights_of_leaves(leaves, label, self.light_extent)
