"""Kollig and Keller's lights: weighted Voronoi cells on the sphere, relaxed while lights are added.

Lights move to the energy centroids of their Voronoi cells, again and again, until none moves any
more (Lloyd's relaxation, weighted by luminous flux). Then the cell with the most energy gets a
second light, and all is relaxed again, until there are as many as wanted. Adding them one by one
where most energy is left keeps the relaxation from getting stuck with too many lights in the dark.
Each light carries its cell's integral of radiance.

Source: Kollig and Keller, "Efficient illumination by high dynamic range images", Eurographics
Symposium on Rendering 2003. That several such sets are used in turn over a pattern of pixels, which
turns bands into noise, is theirs too; here the renderer perturbs one set, as for all others.

Works on at most 256 × 128 cells, each the exact sum of its pixels at their energy centroid, so the
lights carry the map's energy exactly. Their number is exact, but where fewer cells are lit. Cost:
lights × steps of a relaxation × cells, most of which a step leaves alone. The seed draws the first
light and the added ones. The lights are a fixed quadrature: noise-free and biased.

Parameters
    addition : in the cell with the most energy, the new light starts at a pixel drawn in
        proportion to its light ("random", default) or at the "brightest" one. The paper's text was
        not at hand.
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
from samplers.grids.light_leaves import LightLeaves, lights_of_leaves
from samplers.grids.reduced_map import reduce_map
from samplers.kollig_keller.relaxation import Relaxation
from samplers.lighting import LIGHT_EXTENT, DirectionalLights, LightExtent, Sets
from samplers.reference import Reference

ROWS = 128
"""Rows of the grid that is relaxed, at most."""
BETWEEN = 0.05
"""A relaxation between two additions ends when no light moves farther than this share of the
distance to its nearest neighbour; the last one, when no cell changes hands."""
STEPS = 100
"""Steps of a relaxation, at most."""


def next_start(
    leaves: LightLeaves, label: NDArray[np.int64], random: np.random.Generator | None
) -> int | None:
    """The leaf where a light is added: in the cell with most energy that has two leaves or more.

    label : (n,) cells of the leaves; random : draws the leaf by energy, None takes the brightest
    """
    number, energy = np.bincount(label), np.bincount(label, leaves.luminous_flux)
    energy[number < 2] = 0.0
    cell = int(np.argmax(energy))
    if number[cell] < 2:
        return None
    members = np.flatnonzero(label == cell)
    flux = leaves.luminous_flux[members]
    if random is None:
        return int(members[np.argmax(flux / leaves.solid_angle[members])])
    running = np.cumsum(flux)
    place = np.searchsorted(running, random.random() * running[-1], side="right")
    return int(members[min(int(place), len(members) - 1)])


def relaxed_cells(
    leaves: LightLeaves, count: int, random: np.random.Generator | None
) -> NDArray[np.int64]:
    """Labels (n,) of the leaves, from 0: `count` cells, or as many as there are leaves.

    random : see `next_start`
    """
    if count >= len(leaves):
        return np.arange(len(leaves))
    weight = leaves.luminous_flux / leaves.luminous_flux.max()
    # A light whose cell has lost all its leaves stands for nothing; another is added for it.
    most = 2 * count
    cells = Relaxation(leaves.direction, weight, most)
    owned = 0
    while owned < count and cells.count < most:
        start = next_start(leaves, cells.label, random)
        if start is None:
            break
        cells.add(leaves.direction[start])
        cells.relax(BETWEEN, STEPS)
        owned = int(np.count_nonzero(np.bincount(cells.label)))
    cells.relax(0.0, STEPS)
    return np.unique(cells.label, return_inverse=True)[1]


@register("kollig-keller")
@dataclass(frozen=True)
class KolligKeller(LightSampler):
    """Relaxed cells of alike energy, one light each (Kollig and Keller)."""

    label: ClassVar[str] = "Relaxed cells (Kollig 2003)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Thomas Kollig, Alexander Keller",
            "Efficient illumination by high dynamic range images",
            "Eurographics Symposium on Rendering",
            2003,
            doi="10.2312/EGWR/EGWR03/045-051",
        ),
    )
    stochastic: ClassVar[bool] = True

    addition: Literal["random", "brightest"] = "random"
    light_extent: LightExtent = LIGHT_EXTENT
    sets: Sets = "perturbed"

    readings = (
        Reading("new lights where light is drawn", {"addition": "random"}),
        Reading("new lights at the brightest pixel", {"addition": "brightest"}),
    )

    def __post_init__(self) -> None:
        if self.addition not in ("random", "brightest"):
            raise EnvlightError(
                f"kollig-keller: addition is 'random' or 'brightest', not {self.addition!r}"
            )

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> DirectionalLights:
        if environment.is_black:
            return DirectionalLights.none()
        leaves, _ = reduce_map(environment, ROWS).leaves()
        return lights_of_leaves(leaves, self._cells(leaves, count, rng), self.light_extent)

    def labels(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> NDArray[np.int32]:
        """The number (H, 2H) of the cell that each texel lies in, 0 where none is lit."""
        reduced = reduce_map(environment, ROWS)
        leaves, lit = reduced.leaves()
        label = np.zeros(len(lit), np.int32)
        if len(leaves):
            label[lit] = self._cells(leaves, count, rng)
        at = np.arange(environment.width) * reduced.height // environment.height
        return label.reshape(reduced.height, -1)[at[: environment.height, None], at]

    def _cells(
        self, leaves: LightLeaves, count: int, rng: np.random.Generator
    ) -> NDArray[np.int64]:
        return relaxed_cells(leaves, count, rng if self.addition == "random" else None)
