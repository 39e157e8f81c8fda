"""Light of the map that is drawn at each shading point by resampling candidates of two kinds.

What `samplers.resampling` says of candidates, targets and survivors, for any table of the map: a
`samplers.lighting.ResampledCandidates`, which the renderer shades by in place.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from samplers.grids.survivors import along_curve, choose, choose_of_sets, judge
from samplers.lighting import LightDistribution, Surface, SurfaceSamples

NO_CURVE = np.empty(0, np.int32), np.empty(0, np.int32)


@dataclass(frozen=True, eq=False, repr=False)
class ResampledLight:
    """`count` survivors of `from_map` and `from_brdf` candidates at each shading point.

    radiance : (H, 2H, 3) float32, the map
    candidates : the distribution that the map's candidates are drawn from
    curve : of the map, `samplers.grids.survivors.curve_of`, along which survivors are drawn from
        all candidates; None where each has a set of its own
    """

    radiance: NDArray[np.float32]
    candidates: LightDistribution
    count: int
    from_map: int
    from_brdf: int
    curve: tuple[NDArray[np.int32], NDArray[np.int32]] | None
    independent: bool = False

    @property
    def draws(self) -> tuple[int, ...]:
        return self.from_map, self.from_brdf, 1 if self.curve else self.count

    def sample_at(self, surface: Surface, u: list[NDArray[np.float32]]) -> SurfaceSamples:
        points = u[0].shape[1]
        toward_light, map_pdf = self.candidates.sample(u[0].reshape(-1, 3))
        along_brdf = surface.draw(u[1]).reshape(-1, 3)
        direction = np.concatenate([toward_light, along_brdf])
        map_pdf = np.concatenate([map_pdf, self.candidates.pdf(along_brdf)])
        candidates = direction.reshape(-1, points, 3)
        reflected, brdf_pdf = surface.reflect(candidates)
        target, weight = np.empty((2, *candidates.shape[:2]))
        place = np.empty(candidates.shape[:2], np.int32)
        judge(
            direction, self.radiance, reflected.reshape(-1, 3), map_pdf, brdf_pdf.reshape(-1),
            self.from_map, self.from_brdf, self.curve or NO_CURVE, target.reshape(-1),
            weight.reshape(-1), place.reshape(-1),
        )  # fmt: skip
        chosen, scale = np.empty((self.count, points), np.int32), np.empty((self.count, points))
        if self.curve:
            choose(target, weight, place, u[2][0, :, 0], chosen, scale)
        else:
            number = self.from_map // self.count, self.from_brdf // self.count
            choose_of_sets(target, weight, number, u[2][..., 0], chosen, scale)
        survivors = np.take_along_axis(candidates, chosen[..., None], axis=0)
        return SurfaceSamples(survivors, scale)


@dataclass(frozen=True, eq=False)
class OrderedSets:
    """Survivors of sets whose candidates are generated along a curve, by equal steps of u.

    of : without a curve over the map, so that each survivor has a set of its own
    """

    of: ResampledLight

    @property
    def count(self) -> int:
        return self.of.count

    @property
    def draws(self) -> tuple[int, ...]:
        return self.of.from_map, self.of.from_brdf, 1

    def sample_at(self, surface: Surface, u: list[NDArray[np.float32]]) -> SurfaceSamples:
        ordered = [np.empty_like(numbers) for numbers in u[:2]]
        for numbers, found in zip(u, ordered, strict=False):
            along_curve(numbers, len(numbers) // self.count, found)
        steps = (np.arange(self.count)[:, None, None] + u[2].astype(np.float64)) / self.count
        return self.of.sample_at(surface, [*ordered, steps.astype(np.float32)])
