"""ReSTIR: each pixel resamples what its neighbours found, instead of more candidates of its own.

Every shading point draws a few candidates from the map's table and from its BRDF and keeps one of
them in a reservoir, drawn in proportion to target over density, where the target p̂ is the luminance
of L · f_r · cos. It then looks at the reservoirs of a few neighbours, chosen at random in a disc
of pixels and rejected where their normals or depths differ, and draws one of all of them in
proportion to its own target. So a point profits of some hundred candidates for which it did not
pay. One ray finds out whether the survivor arrives.

    W_i = Σ_j w_j / p̂_i(x_i)                                 of a reservoir's survivor x_i
    w_j = m_j(x_j) p̂_i(x_j) W_j                              of reservoir j for point i
    E   = L(x) f_r(x) cos θ V(x) W

What a neighbour keeps is not drawn by the point's own density, so that m_j must share out each
direction among all points that may have kept it: Σ_j m_j(x) = 1. Otherwise what a neighbour cannot
see is lost.

Source: Bitterli, Wyman, Pharr, Shirley, Lefohn and Jarosz, "Spatiotemporal reservoir resampling for
real-time ray tracing with dynamic direct lighting", SIGGRAPH 2020 (algorithms 3 to 6, the limits
for neighbours); Lin, Kettunen, Bitterli, Pantaleoni, Yuksel and Wyman, "Generalized resampled
importance sampling: foundations of ReSTIR", SIGGRAPH 2022 (the generalised balance heuristic);
Bitterli, "Correlations and reuse for fast and accurate physically based light transport",
dissertation, Dartmouth 2022 (pairwise weights, which are here those of neighbours against the
point, each pair with its share). Wu 2025 compares with Zhang et al., "Area ReSTIR", SIGGRAPH 2024,
which adds the lens and the pixel's area. The view is still here, and the light an environment map.

Unbiased, but with weights="biased". Neighbours that share a survivor err alike: noise has larger
grains than that of other methods. Costs `candidates` look-ups, and one or two reflectances for each
neighbour, a ray.

A budget of K samples gives K / rays independent reservoirs at each point, where rays are those of a
reservoir: one with visibility="last".

Parameters
    candidates : 8 (default) for each reservoir, half from the map and half from the BRDF; the paper
        has 32
    neighbours : 3 (default), the paper's for its unbiased form
    radius : 30 (default) pixels, the paper's
    normal : 25 (default) degrees between the normals of neighbours at most, the paper's
    depth : 0.1 (default), difference of their depths at most, relative, the paper's
    weights : m_j by "pairwise" (default) or "balance" heuristic, the latter among all at once; or
        "biased", in proportion to the candidates that a reservoir stands for
    visibility : the survivor's ray is traced "last" (default), or "first", before it is shared, as
        the paper does. Weights then ask whether others see it too, with a ray for each pair; it is
        what makes them unbiased, and what "biased" spares.
    frames : 1 (default); with more, each frame draws candidates anew and goes on from the
        reservoirs of the one before, and the last is the image
    denoise : True has the image denoised (`renderer.denoise`, an extra) in its time; then it is
        biased. False (default)
    cap : 20 (default) times the candidates of a frame is what a reservoir of earlier ones counts
        for at most, the paper's
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler, register
from samplers.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from samplers.errors import EnvlightError
from samplers.grids.resampled_light import NO_CURVE, ResampledLight
from samplers.grids.survivors import choose_of_sets, judge
from samplers.grids.tabulated import by_luminance
from samplers.lighting import Picture, Surface, SurfaceDistribution, SurfaceSamples
from samplers.reference import Reference
from samplers.resampling import MORE
from samplers.sphere import pixels_of
from samplers.threads import for_blocks

POINTS = 2048
"""Points that a thread works on at once."""
OF_MAP, OF_BRDF, SURVIVOR, MERGED, NEIGHBOURS, REUSED = range(6)
"""Streams of random numbers."""
STREAMS = 6

PRINTED = {"fixed": "its paper prints the value"}

Weights = Literal["pairwise", "balance", "biased"]


@dataclass(frozen=True, eq=False)
class Reservoirs:
    """What the n points of a picture keep.

    direction : (n, 3) float32; weight : (n,), W in sr, 0 for nothing
    target : (n,), p̂ of the direction at the point itself
    number : (n,), candidates that it stands for
    """

    direction: NDArray[np.float32]
    weight: NDArray[np.float64]
    target: NDArray[np.float64]
    number: NDArray[np.float64]

    @classmethod
    def of(cls, count: int) -> "Reservoirs":
        return cls(np.empty((count, 3), np.float32), *np.zeros((3, count)))

    def put(self, rows: slice, direction: NDArray, weight: NDArray, target: NDArray,
            number: NDArray | float) -> None:  # fmt: skip
        """Set the points of `rows`."""
        self.direction[rows], self.weight[rows] = direction, weight
        self.target[rows], self.number[rows] = target, number


def survivors(
    weight: NDArray[np.float64], target: NDArray[np.float64], u: NDArray[np.float32]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Which of k reservoirs survives at each of p points (p,), and its W.

    weight, target : (k, p), w and p̂ of the point; u : (p,) in [0, 1)
    """
    running = np.cumsum(weight, axis=0)
    total = running[-1]
    chosen = (running <= u * total).sum(axis=0)
    # The sum may end a rounding below what is to be passed: the last that weighs is meant.
    last = len(weight) - 1 - np.argmax(weight[::-1] > 0.0, axis=0)
    chosen = np.minimum(chosen, last)
    own = np.take_along_axis(target, chosen[None], axis=0)[0]
    return chosen, np.divide(total, own, out=np.zeros(len(total)), where=own > 0.0)


def shares(
    kind: Weights, target: NDArray[np.float64], number: NDArray[np.float64]
) -> NDArray[np.float64]:
    """m_j of each reservoir's own survivor (k, p).

    target : (k, k, p), that of survivor b at point a; "pairwise" reads the first row and column and
        the diagonal, "biased" nothing
    number : (k, p), candidates of the reservoirs, 0 for those that take no part
    """
    if kind == "biased":
        return number / number.sum(axis=0)
    each = np.arange(len(number))
    own = number * target[each, each]
    if kind == "balance":
        among = (number[:, None] * target).sum(axis=0)
        return np.divide(own, among, out=np.zeros_like(own), where=among > 0.0)
    # Each neighbour shares its part of the whole with the point: together they stand against it.
    others = number[1:].sum(axis=0)
    pair = number[0] * target[0, 1:] + others * target[each[1:], each[1:]]
    found = np.divide(own[1:], pair, out=np.zeros_like(own[1:]), where=pair > 0.0)
    pair = own[0] + others * target[1:, 0]
    part = np.divide(number[1:] * own[0], pair, out=np.zeros_like(pair), where=pair > 0.0)
    first = np.divide(part.sum(axis=0), others, out=np.ones(len(others)), where=others > 0.0)
    return np.concatenate([first[None], found])


@dataclass(frozen=True, eq=False, repr=False)
class ReservoirLight:
    """Reservoirs at each point, which look at their neighbours': `PictureDistribution`.

    alone : what a point without neighbours gets, of as many candidates for each sample
    """

    of: "ReSTIR"
    alone: ResampledLight

    @property
    def count(self) -> int:
        return self.alone.count

    @property
    def denoised(self) -> bool:
        return self.of.denoise

    @property
    def draws(self) -> tuple[int, ...]:
        return self.alone.draws

    @property
    def independent(self) -> bool:
        return self.alone.independent

    def sample_at(self, surface: Surface, u: list[NDArray[np.float32]]) -> SurfaceSamples:
        return self.alone.sample_at(surface, u)

    def sample_picture(self, picture: Picture) -> Iterator[SurfaceSamples]:
        # Unbiased weights have found out already whether the survivor arrives.
        known = self.of.visibility == "first" and self.of.weights != "biased"
        for k in range(self.count // self.of.rays):
            kept: Reservoirs | None = None
            for frame in range(self.of.frames):
                stream = (k * self.of.frames + frame) * STREAMS
                kept = self._reused(picture, stream, self._found(picture, stream, kept))
            assert kept is not None
            yield SurfaceSamples(kept.direction[None], kept.weight[None], shadowed=not known)

    def _targets(
        self, picture: Picture, point: NDArray[np.int64], direction: NDArray[np.float32]
    ) -> NDArray[np.float64]:
        """p̂ of directions (m, 3) at points (m,)."""
        reflected = picture.reflect_at(point, direction)[0].astype(np.float64)
        radiance = self.alone.radiance
        row, column = np.empty((2, len(point)), np.int32)
        pixels_of(direction, len(radiance), row, column)
        found: NDArray[np.float64] = (reflected * radiance[row, column]) @ LUMINANCE_WEIGHTS
        return found

    def _found(self, picture: Picture, stream: int, before: Reservoirs | None) -> Reservoirs:
        """Reservoirs of new candidates, and of what the points kept before."""
        found = Reservoirs.of(len(picture.pixel))

        def find(start: int, stop: int) -> None:
            rows = slice(start, stop)
            direction, weight, target = self._drawn(picture, stream, start, stop)
            if self.of.visibility == "first":
                weight *= picture.sees(np.arange(start, stop), direction, weight > 0.0)
            if before is None:
                found.put(rows, direction, weight, target, self.of.candidates)
                return
            # Both were drawn for the same target, so that their numbers alone share them out.
            number = np.full((2, stop - start), float(self.of.candidates))
            number[1] = np.minimum(before.number[rows], self.of.cap * number[0])
            both = np.stack([target, before.target[rows]])
            share = number / number.sum(axis=0)
            u = picture.numbers(stream + MERGED, start, stop, 1)[0, :, 0]
            chosen, kept = survivors(
                share * both * np.stack([weight, before.weight[rows]]), both, u
            )
            old = chosen == 1
            found.put(
                rows, np.where(old[:, None], before.direction[rows], direction), kept,
                np.where(old, before.target[rows], target), number.sum(axis=0),
            )  # fmt: skip

        for_blocks(find, len(picture.pixel), POINTS)
        return found

    def _drawn(
        self, picture: Picture, stream: int, start: int, stop: int
    ) -> tuple[NDArray[np.float32], NDArray[np.float64], NDArray[np.float64]]:
        """Direction, W and target of the survivors of the points' own candidates."""
        points, number = np.arange(start, stop), self.of.split
        of_map, of_brdf = (
            picture.numbers(stream + which, start, stop, count).reshape(-1, 3)
            for which, count in ((OF_MAP, number[0]), (OF_BRDF, number[1]))
        )
        toward_light, map_pdf = self.alone.candidates.sample(np.ascontiguousarray(of_map))
        along_brdf = picture.draw_at(np.tile(points, number[1]), np.ascontiguousarray(of_brdf))
        direction = np.concatenate([toward_light, along_brdf])
        map_pdf = np.concatenate([map_pdf, self.alone.candidates.pdf(along_brdf)])
        reflected, brdf_pdf = picture.reflect_at(np.tile(points, sum(number)), direction)
        target, weight = np.empty((2, sum(number), len(points)))
        judge(
            direction, self.alone.radiance, reflected, map_pdf, brdf_pdf, *number, NO_CURVE,
            target.reshape(-1), weight.reshape(-1), np.empty(weight.size, np.int32),
        )  # fmt: skip
        chosen, scale = np.empty((1, len(points)), np.int32), np.empty((1, len(points)))
        u = picture.numbers(stream + SURVIVOR, start, stop, 1)[..., 0]
        choose_of_sets(target, weight, number, u, chosen, scale)
        each = np.arange(len(points))
        way = direction.reshape(sum(number), -1, 3)[chosen[0], each]
        return way, scale[0], target[chosen[0], each]

    def _neighbours(self, picture: Picture, stream: int, start: int, stop: int) -> NDArray:
        """Points (k, p) near those from start to stop, −1 for none."""
        u = picture.numbers(stream + NEIGHBOURS, start, stop, self.of.neighbours)
        reach, turn = self.of.radius * np.sqrt(u[..., 0]), 2.0 * np.pi * u[..., 1]
        pixel = picture.pixel[start:stop]
        x = pixel % picture.width + np.rint(reach * np.cos(turn)).astype(np.int64)
        y = pixel // picture.width + np.rint(reach * np.sin(turn)).astype(np.int64)
        inside = (x >= 0) & (x < picture.width) & (y >= 0) & (y < picture.height)
        order, begin = picture.by_pixel
        at = np.where(inside, y * picture.width + x, 0)
        there = begin[at + 1] - begin[at]
        place = begin[at] + np.minimum((u[..., 2] * there).astype(np.int64), there - 1)
        point = order[np.minimum(place, len(order) - 1)]
        here = np.arange(start, stop)
        alike = (picture.normal[point] * picture.normal[here]).sum(axis=-1)
        near = np.abs(picture.depth[point] - picture.depth[here])
        good = inside & (there > 0) & (point != here)
        good &= alike >= np.cos(np.radians(self.of.normal))
        good &= near <= self.of.depth * picture.depth[here]
        return np.where(good, point, -1)

    def _reused(self, picture: Picture, stream: int, kept: Reservoirs) -> Reservoirs:
        """Reservoirs of what the points and their neighbours kept."""
        found = Reservoirs.of(len(picture.pixel))

        def reuse(start: int, stop: int) -> None:
            near = self._neighbours(picture, stream, start, stop)
            point = np.concatenate([np.arange(start, stop)[None], np.maximum(near, 0)])
            part = np.concatenate([np.ones((1, stop - start), np.bool_), near >= 0])
            number = np.where(part, kept.number[point], 0.0)
            target = self._cross_targets(picture, kept, point, part)
            share = shares(self.of.weights, target, number)
            u = picture.numbers(stream + REUSED, start, stop, 1)[0, :, 0]
            chosen, weight = survivors(
                share * target[0] * np.where(part, kept.weight[point], 0.0), target[0], u
            )
            each = np.arange(stop - start)
            found.put(
                slice(start, stop), kept.direction[point[chosen, each]], weight,
                target[0][chosen, each], number.sum(axis=0),
            )  # fmt: skip

        for_blocks(reuse, len(picture.pixel), POINTS)
        return found

    def _cross_targets(
        self, picture: Picture, kept: Reservoirs, point: NDArray[np.int64], part: NDArray[np.bool_]
    ) -> NDArray[np.float64]:
        """p̂ of what point b keeps at point a, (k, k, p), so far as weights read it; with
        visibility where what is kept has passed that test."""
        k, points = point.shape
        found = np.zeros((k, k, points))
        found[np.arange(k), np.arange(k)] = np.where(part, kept.target[point], 0.0)
        pairs = [(0, b) for b in range(1, k)]
        if self.of.weights != "biased":
            pairs += [(a, 0) for a in range(1, k)]
        if self.of.weights == "balance":
            pairs += [(a, b) for a in range(1, k) for b in range(1, k) if a != b]
        if not pairs:
            return found
        at, of = (np.concatenate([point[pair[side]] for pair in pairs]) for side in (0, 1))
        used = np.concatenate([part[a] & part[b] for a, b in pairs]) & (kept.weight[of] > 0.0)
        value = np.zeros(len(at))
        direction = kept.direction[of[used]]
        value[used] = self._targets(picture, at[used], direction)
        if self.of.visibility == "first" and self.of.weights != "biased":
            value[used] *= picture.sees(at[used], direction, value[used] > 0.0)
        for pair, values in zip(pairs, value.reshape(len(pairs), points), strict=True):
            found[pair] = values
        return found


@register("restir")
@dataclass(frozen=True)
class ReSTIR(LightSampler):
    """Reservoirs that neighbours share (ReSTIR)."""

    label: ClassVar[str] = "ReSTIR (Bitterli 2020)"
    references: ClassVar[tuple[Reference, ...]] = (
        Reference(
            "Benedikt Bitterli, Chris Wyman, Matt Pharr, Peter Shirley, Aaron Lefohn, "
            "Wojciech Jarosz",
            "Spatiotemporal reservoir resampling for real-time ray tracing with dynamic direct "
            "lighting",
            "ACM Transactions on Graphics",
            2020,
            kind="article",
            volume="39(4)",
            doi="10.1145/3386569.3392481",
        ),
        Reference(
            "Daqi Lin, Markus Kettunen, Benedikt Bitterli, Jacopo Pantaleoni, Cem Yuksel, "
            "Chris Wyman",
            "Generalized resampled importance sampling: foundations of ReSTIR",
            "ACM Transactions on Graphics",
            2022,
            kind="article",
            volume="41(4)",
            doi="10.1145/3528223.3530158",
        ),
    )
    stochastic: ClassVar[bool] = True
    in_all_tables: ClassVar[bool] = False  # it takes many times as long as others for a budget

    candidates: int = field(default=8, metadata={"readings": (32,), "ruled_out": {32: MORE}})
    neighbours: int = field(default=3, metadata={"readings": (5,)})
    radius: float = field(
        default=30.0,
        metadata={"readings": (10.0,), "ruled_out": {10.0: "its paper looks within 30 pixels"}},
    )
    normal: float = field(default=25.0, metadata=PRINTED)
    depth: float = field(default=0.1, metadata=PRINTED)
    weights: Weights = field(
        default="pairwise",
        metadata={"ruled_out": {"biased": "it loses light; its paper has an unbiased form"}},
    )
    visibility: Literal["last", "first"] = "last"
    frames: int = field(
        default=1,
        metadata={
            "readings": (8,),
            "ruled_out": {8: "images of eight frames, for the cost of eight"},
        },
    )
    cap: float = field(default=20.0, metadata=PRINTED)
    denoise: bool = field(default=False, metadata={"fixed": "an extra, and no way of sampling"})

    costly = ("candidates", "neighbours", "weights", "visibility", "frames")

    def __post_init__(self) -> None:
        for name, least in (("candidates", 2), ("neighbours", 0), ("frames", 1)):
            if getattr(self, name) < least:
                raise EnvlightError(f"restir: {name} {getattr(self, name)}; use at least {least}")
        for name in ("radius", "depth", "cap"):
            if not getattr(self, name) >= 0.0:
                raise EnvlightError(f"restir: {name} {getattr(self, name)}; use 0 or more")
        if not 0.0 <= self.normal <= 180.0:
            raise EnvlightError(f"restir: normal {self.normal}; use degrees from 0 to 180")
        object.__setattr__(self, "minimum_count", self.rays)

    @property
    def split(self) -> tuple[int, int]:
        """Candidates of the map and of the BRDF."""
        return self.candidates - self.candidates // 2, self.candidates // 2

    @property
    def rays(self) -> int:
        """Of a reservoir, with those of all its frames, at most."""
        if self.visibility == "last":
            return 1
        pairs = {
            "pairwise": 2 * self.neighbours,
            "balance": (self.neighbours + 1) * self.neighbours,
            "biased": 0,
        }[self.weights]
        return self.frames * (1 + pairs) + (self.weights == "biased")

    def _prepare(
        self, environment: EnvironmentMap, count: int, rng: np.random.Generator
    ) -> SurfaceDistribution:
        of_map, of_brdf = self.split
        alone = ResampledLight(
            environment.radiance, by_luminance(environment, count), count, of_map * count,
            of_brdf * count, curve=None, independent=True,
        )  # fmt: skip
        return ReservoirLight(self, alone)
