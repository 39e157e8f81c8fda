"""Stratified regions: a fixed set's regions, of each of which every point draws a direction anew.

Median cut, or Kollig and Keller's relaxation, cuts the map into regions of alike energy. Where
those methods put one light into each for the whole picture, here each shading point draws one
random direction in each region, in proportion to the light there. The regions are the strata of a
Monte Carlo estimate: what a light stands for is no longer wrong everywhere in the same way, but
noisy, and right on average.

    E = Σ over regions of L(ω_s) f_r(ω_s) cos θ_s V(ω_s) / p_s(ω_s),   ω_s ~ p_s, in region s alone

Source: Mei, Jaeger and Hu, "An effective stratified sampling scheme for environment maps with
median cut method", CGIV 2006 (median cut); Kollig and Keller, "Efficient illumination by high
dynamic range images", EGSR 2003, for the other regions.

Unbiased. Building costs the regions and a sort of the map's texels by region; a sample is a binary
search. BRDFs take no part: sharp highlights are noisy.

Parameters
    regions : of "median-cut" (default) or "kollig-keller", each at its defaults
    within : directions in a region in proportion to "luminance" (default) or evenly in
        "solid-angle". The paper's text was not at hand.
"""

from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler, register
from samplers.compiled import kernel
from samplers.environment import EnvironmentMap
from samplers.grids.sphere_grid import by_label
from samplers.grids.tabulated import INSET
from samplers.kollig_keller import KolligKeller
from samplers.lighting import Surface, SurfaceDistribution, SurfaceSamples
from samplers.median_cut import MedianCut
from samplers.reference import Reference
from samplers.sphere import direction_from_uv

NOWHERE = -1


@kernel
def _draw(u, begin, end, running, number):
    """Places in the running sums (p,), each between begin and end, for random numbers u (p,)."""
    below = running[begin - 1] if begin > 0 else 0.0
    for i in range(len(u)):
        passed = below + np.float64(u[i]) * (running[end - 1] - below)
        low, high = begin, end - 1
        while low < high:
            middle = (low + high) // 2
            if running[middle] > passed:
                high = middle
            else:
                low = middle + 1
        number[i] = low


@kernel
def _running(texel, weight, row_solid_angle):
    """Running sums (n,) of weight × solid angle of texels."""
    total, out = 0.0, np.empty(len(texel))
    width = len(weight) // len(row_solid_angle)
    for i in range(len(texel)):
        total += np.float64(weight[texel[i]]) * row_solid_angle[texel[i] // width]
        out[i] = total
    return out


@dataclass(frozen=True, eq=False, repr=False)
class RegionLight:
    """A direction in each of k regions, at each shading point.

    texel : (n,), those that may be drawn, region after region; begin : (k + 1,)
    running : (n,) float64, sums of weight × solid angle; weight : (H, 2H)
    """

    texel: NDArray[np.int32]
    begin: NDArray[np.int64]
    running: NDArray[np.float64]
    weight: NDArray[np.float32]
    count: int

    @property
    def draws(self) -> tuple[int, ...]:
        return (1,) * max(1, len(self.begin) - 1)

    def sample_at(self, surface: Surface, u: list[NDArray[np.float32]]) -> SurfaceSamples:
        (height, width), (_, points, _) = self.weight.shape, u[0].shape
        regions = len(self.begin) - 1
        direction = np.zeros((len(self.draws), points, 3), np.float32)
        weight, number = np.zeros(direction.shape[:2]), np.empty(points, np.int64)
        total = np.diff(np.concatenate([[0.0], self.running[self.begin[1:] - 1]]))
        for s in range(regions):
            _draw(u[s][0, :, 0], self.begin[s], self.begin[s + 1], self.running, number)
            row, column = np.divmod(self.texel[number], width)
            edge = np.cos(np.array([row, row + 1]) * (np.pi / height))
            down, along = np.clip(u[s][0, :, 1:], INSET, 1.0 - INSET).T.astype(np.float64)
            y = edge[0] + down * (edge[1] - edge[0])
            v = np.arccos(np.clip(y, -1.0, 1.0)) / np.pi
            direction[s] = direction_from_uv((column + along) / width, v)
            weight[s] = regions * total[s] / self.weight[row, column]
        return SurfaceSamples(direction, weight)


@register("stratified-regions")
@dataclass(frozen=True)
class StratifiedRegions(LightSampler):
    """A random direction in each region of a fixed set (Mei, Jaeger and Hu)."""

    label: ClassVar[str] = "Stratified regions (Mei 2006)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Xing Mei, Marc Jaeger, Baogang Hu",
            "An effective stratified sampling scheme for environment maps with median cut method",
            "Computer Graphics, Imaging and Visualisation",
            2006,
            doi="10.1109/CGIV.2006.19",
        ),
    )
    stochastic: ClassVar[bool] = True

    regions: Literal["median-cut", "kollig-keller"] = field(
        default="median-cut",
        metadata={"ruled_out": {"kollig-keller": "its paper takes the regions of median cut"}},
    )
    within: Literal["luminance", "solid-angle"] = "luminance"

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> SurfaceDistribution:
        cut = MedianCut() if self.regions == "median-cut" else KolligKeller()
        label = cut.labels(environment, count, rng).reshape(-1)
        weight = environment.luminance
        if self.within == "solid-angle":
            weight = (weight > 0.0).astype(np.float32)
        label[weight.reshape(-1) == 0.0] = NOWHERE
        texel, start = by_label(label, int(label.max()) + 1)
        del label
        running = _running(texel, weight.reshape(-1), environment.row_solid_angle)
        return RegionLight(texel, np.unique(start), running, weight, count)
