"""What a sampler may return: five kinds of lighting, the only ones the renderer knows.

Directions are unit vectors towards the light. Irradiance is on a plane that faces the light,
E = ∫ L dω over the light's cluster, linear Rec. 709 RGB.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from samplers.environment import EnvironmentMap
from samplers.errors import EnvlightError
from samplers.preview import lights_thumbnail

LightExtent = Literal["mean", "largest", "full"]
"""What a light's extent is: the mean or the largest angle to the members of its cluster, or twice
the largest, the full angle that a cluster takes."""
LIGHT_EXTENT: LightExtent = "largest"
"""The default of every sampler that has a choice."""

Sets = Literal["perturbed", "independent"]
"""How interleaved sampling comes by its sets: from one whose lights are perturbed, or from as many
calls of the method."""
SETS = 8
"""Sets of interleaved sampling."""


def extent_of(
    which: LightExtent,
    mean: Callable[[], NDArray[np.float64]],
    largest: Callable[[], NDArray[np.float64]],
) -> NDArray[np.float64]:
    """The extents (n,) by name, of the mean and the largest angles, which are made on demand."""
    if which == "mean":
        return mean()
    return largest() if which == "largest" else 2.0 * largest()


def size_of(flux: NDArray[np.float64], square: NDArray[np.float64]) -> NDArray[np.float64]:
    """Size of lights as angular radius (n,) in radians, from F = ∫ Y dω and ∫ Y² dω over each.

    It is that of an even cap with flux F and the mean luminance weighted by flux, ∫ Y² dω / F: a
    sun in a dim sky gives the sun's, a grey sky that of the whole cell, and nothing gives more than
    its cell. Not what interleaved sampling perturbs by. 0 where all is black, or so dim that the
    square vanishes.
    """
    solid_angle = np.divide(flux * flux, square, out=np.zeros(len(flux)), where=square > 0.0)
    return 2.0 * np.arcsin(np.sqrt(np.minimum(solid_angle / (4.0 * np.pi), 1.0)))


def _checked(name: str, array: NDArray, shape: tuple[int | None, ...]) -> NDArray[np.float64]:
    """A C-contiguous float64 copy of the wanted shape (None: any length), finite throughout."""
    if np.iscomplexobj(array):
        raise EnvlightError(f"lighting: {name} is complex; wanted real numbers")
    result = np.array(array, np.float64, order="C")
    wanted = ", ".join("n" if size is None else str(size) for size in shape)
    if result.ndim != len(shape) or any(
        size is not None and size != got for size, got in zip(shape, result.shape, strict=True)
    ):
        raise EnvlightError(f"lighting: {name} has shape {result.shape}, wanted ({wanted})")
    if not np.isfinite(result).all():
        raise EnvlightError(f"lighting: {name} holds NaN or infinity")
    result.flags.writeable = False
    return result


def _check_lights(direction: NDArray, irradiance: NDArray, angle: NDArray, angle_name: str) -> None:
    if not len(direction) == len(irradiance) == len(angle):
        raise EnvlightError(
            f"lighting: {len(direction)} directions, {len(irradiance)} irradiances and "
            f"{len(angle)} values of {angle_name}; the numbers must agree"
        )
    if len(direction) and np.abs(np.linalg.norm(direction, axis=1) - 1.0).max() > 1e-6:
        raise EnvlightError("lighting: a direction is not of unit length")
    if (irradiance < 0.0).any():
        raise EnvlightError("lighting: negative irradiance")
    if (angle < 0.0).any():
        raise EnvlightError(f"lighting: negative {angle_name}")


@dataclass(frozen=True, eq=False)
class DirectionalLights:
    """One global set of directional lights for all shading points.

    direction : (n, 3) float64, unit, towards the light
    irradiance : (n, 3) float64, ∫ L dω of the light's cluster, W·m⁻² per channel
    extent : (n,) float64, how far the cluster reaches, in radians, as `LightExtent` has it; a mean
        is weighted by solid angle. Interleaved sampling perturbs by it.
    further_sets : other sets of lights for the same map, which interleaved sampling uses in turn
        with this one before it perturbs any
    """

    direction: NDArray[np.float64]
    irradiance: NDArray[np.float64]
    extent: NDArray[np.float64]
    further_sets: tuple["DirectionalLights", ...] = ()

    def __post_init__(self) -> None:
        for name, shape in (
            ("direction", (None, 3)),
            ("irradiance", (None, 3)),
            ("extent", (None,)),
        ):
            object.__setattr__(self, name, _checked(name, getattr(self, name), shape))
        _check_lights(self.direction, self.irradiance, self.extent, "extent")
        if any(lights.further_sets for lights in self.further_sets):
            raise EnvlightError("lighting: a further set has further sets of its own")

    def __len__(self) -> int:
        return len(self.direction)

    def __repr__(self) -> str:
        further = f", {len(self.further_sets)} further sets" if self.further_sets else ""
        return f"DirectionalLights({len(self)} lights{further})"

    def _repr_png_(self) -> bytes:
        return lights_thumbnail(self.direction, self.irradiance)

    @classmethod
    def none(cls) -> "DirectionalLights":
        """No light at all: what a black map gives."""
        return cls(np.empty((0, 3)), np.empty((0, 3)), np.empty(0))

    @property
    def sets(self) -> tuple["DirectionalLights", ...]:
        """This set and the further ones."""
        return (self, *self.further_sets)


@runtime_checkable
class LightDistribution(Protocol):
    """A density over directions, drawn from afresh at each shading point.

    The renderer combines it with BRDF sampling by the power heuristic and takes radiance from the
    environment map itself. Every method must release the interpreter lock or be quick; they are
    called from several threads at once and must not keep state.

    Its random numbers come from a low-discrepancy sequence per pixel, unless it carries an
    attribute `independent` that is true. The renderer takes the noise off the image where an
    attribute `denoised` is true (`renderer.denoise`, an extra).
    """

    @property
    def count(self) -> int:
        """Samples per shading point, light and BRDF samples together."""
        ...

    def sample(self, u: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Directions (n, 3), unit, and their pdf (n,) in sr⁻¹, for random numbers (n, 3) in [0, 1).

        The first two numbers are the best stratified ones.
        """
        ...

    def pdf(self, direction: NDArray[np.float32]) -> NDArray[np.float32]:
        """Density (n,) in sr⁻¹ of the unit directions (n, 3); zero where none is ever drawn."""
        ...


class TexelTable(NamedTuple):
    """Running sums over the texels of a map of H rows, by which kernels draw a texel.

    prefix : (2H²,) float64, of weight × solid angle along each row, row after row
    row_sum : (H,) float64, their last ones
    guide : (H (G + 1),) int32, where to search in each row, for G steps of the random number
    marginal, marginal_guide : (H,) float64 and (G' + 1,) int32, the same for the rows' sums
    edge_cosine : (H + 1,) float64, cos θ of the rows' edges
    """

    prefix: NDArray[np.float64]
    row_sum: NDArray[np.float64]
    guide: NDArray[np.int32]
    marginal: NDArray[np.float64]
    marginal_guide: NDArray[np.int32]
    edge_cosine: NDArray[np.float64]


@runtime_checkable
class TabulatedLight(LightDistribution, Protocol):
    """A light distribution over texels of the map, uniform within each: the renderer's fast path.

    The renderer draws from the table in place and calls neither `sample` nor `pdf`, which must
    therefore give what the table does: `samplers.grids.tabulated.TabulatedDistribution.of_weight`
    makes all of it from weights. The density is max(0, weight − offset) / table.marginal[-1].
    """

    @property
    def weight(self) -> NDArray[np.float32]:
        """(H, 2H), C-contiguous, of the map's own size, else nothing is drawn in place; where it
        is `EnvironmentMap.luminance` itself, densities cost no look-up of their own."""
        ...

    @property
    def offset(self) -> float:
        """What is taken off all weights."""
        ...

    @property
    def table(self) -> TexelTable:
        """Of max(0, weight − offset)."""
        ...


class Surface(Protocol):
    """Shading points as a distribution sees them: p of them, a multiple of sixteen.

    Arrays over samples are (k, p, …): sample after sample, each of all points. Directions are unit
    and point away from the surface.
    """

    @property
    def position(self) -> NDArray[np.float32]:
        """(p, 3), just above the surface."""
        ...

    @property
    def normal(self) -> NDArray[np.float32]:
        """(p, 3), unit, the shading normal on the eye's side."""
        ...

    @property
    def toward_eye(self) -> NDArray[np.float32]:
        """(p, 3), unit."""
        ...

    @property
    def material(self) -> NDArray[np.int32]:
        """(p,), a number for each material: equal ones reflect alike."""
        ...

    def reflect(
        self, direction: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """f_r · n·l (k, p, 3) and the density in sr⁻¹ (k, p) of `draw` for directions (k, p, 3).

        Both are 0 for directions below the surface.
        """
        ...

    def draw(self, u: NDArray[np.float32]) -> NDArray[np.float32]:
        """Directions (k, p, 3) in proportion to the BRDF, for random numbers (k, p, 3) in [0, 1).

        They may go below the surface.
        """
        ...


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Samples of light at shading points: the mean of k of them estimates a point's radiance.

    direction : (k, p, 3) float32, unit
    weight : (k, p), in sr, one over the density, or what stands for it; 0 for no sample
    radiance : (k, p, 3), what comes from there; None for the map's
    shadowed : whether a ray finds out if it arrives
    """

    direction: NDArray[np.float32]
    weight: NDArray[np.float64]
    radiance: NDArray[np.float32] | None = None
    shadowed: bool = True


@runtime_checkable
class SurfaceDistribution(Protocol):
    """Directions drawn afresh at each shading point by what its surface is: product sampling.

    The renderer adds nothing of its own: radiance is the mean over the samples of
    L · f_r · n·l · visibility · weight. Called from several threads at once; it must not keep state
    and should release the interpreter lock or be quick. Random numbers are those of a
    `LightDistribution`: independent where an attribute `independent` is true.
    """

    @property
    def count(self) -> int:
        """Samples, and shadow rays, per shading point at most."""
        ...

    @property
    def draws(self) -> tuple[int, ...]:
        """How many points of each of its low-discrepancy sequences a shading point uses."""
        ...

    def sample_at(self, surface: Surface, u: list[NDArray[np.float32]]) -> SurfaceSamples:
        """Samples at the points of a surface.

        u : for each of `draws` the points (draws[i], p, 3) in [0, 1); the sequences are independent
            of each other, and the first two numbers of a point are the best stratified ones
        """
        ...


@runtime_checkable
class ResampledCandidates(SurfaceDistribution, Protocol):
    """Survivors of candidates from a table of the map and from the BRDF: the renderer's fast path.

    Where the table is a `TabulatedLight` of the map that is rendered, the renderer draws, judges
    and chooses in place and does not call `sample_at`, which must therefore give what
    `samplers.grids.resampled_light.ResampledLight` does.
    """

    @property
    def radiance(self) -> NDArray[np.float32]:
        """Of the map, by which candidates are judged."""
        ...

    @property
    def candidates(self) -> LightDistribution:
        """What the map's candidates are drawn from."""
        ...

    @property
    def from_map(self) -> int:
        """Candidates of the map at each point."""
        ...

    @property
    def from_brdf(self) -> int:
        """Candidates of the BRDF at each point."""
        ...

    @property
    def curve(self) -> tuple[NDArray[np.int32], NDArray[np.int32]] | None:
        """`samplers.grids.survivors.curve_of` the map, along which all survivors are drawn from
        all candidates; None where each is drawn from as large a share of them."""
        ...


class Picture(Protocol):
    """All n shading points of a picture, for a distribution whose points may use each other's.

    Points are named by their numbers 0 … n − 1, directions are unit. Every method may be called
    from several threads at once.
    """

    @property
    def width(self) -> int:
        """In pixels."""
        ...

    @property
    def height(self) -> int:
        """In pixels."""
        ...

    @property
    def normal(self) -> NDArray[np.float32]:
        """(n, 3), the shading normal on the eye's side."""
        ...

    @property
    def depth(self) -> NDArray[np.float32]:
        """(n,), distance to the eye."""
        ...

    @property
    def pixel(self) -> NDArray[np.int32]:
        """(n,), row-major."""
        ...

    @property
    def by_pixel(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The points in the order of their pixels (n,), and where in it each pixel's begin
        (width · height + 1,)."""
        ...

    def numbers(self, stream: int, start: int, stop: int, count: int) -> NDArray[np.float32]:
        """Independent random numbers (count, stop − start, 3) in [0, 1) of the points from start to
        stop, the same for the same stream."""
        ...

    def reflect_at(
        self, point: NDArray[np.int64], direction: NDArray[np.float32]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """f_r · n·l (m, 3) and `draw_at`'s density (m,) of directions (m, 3) at points (m,)."""
        ...

    def draw_at(self, point: NDArray[np.int64], u: NDArray[np.float32]) -> NDArray[np.float32]:
        """Directions (m, 3) in proportion to the BRDF at points (m,), by random numbers (m, 3)."""
        ...

    def sees(
        self, point: NDArray[np.int64], direction: NDArray[np.float32], asked: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Whether nothing hides the directions (m, 3) from the points (m,), False where not asked.
        A ray each is traced, and counted, where it is asked for."""
        ...


@runtime_checkable
class PictureDistribution(SurfaceDistribution, Protocol):
    """Directions drawn at all points of a picture together, which may use their neighbours'.

    The renderer calls `sample_picture` once for an image; `sample_at` tells what a surface without
    neighbours gets.
    """

    def sample_picture(self, picture: Picture) -> Iterator[SurfaceSamples]:
        """Samples (k, n) at all points of the picture, one batch after another, so that only one is
        held: the image is the mean of L · f_r · n·l · visibility · weight over all of them, at most
        `count`, towards which the rays that `picture.sees` traces count as well."""
        ...


@dataclass(frozen=True, eq=False)
class DiscLights:
    """Uniform spherical-cap lights that cast soft shadows, and an ambient remainder.

    direction : (n, 3) float64, unit, towards the cap's centre
    irradiance : (n, 3) float64, ∫ L dω over the cap
    half_angle : (n,) float64, angular radius of the cap in radians, positive
    ambient : the map's remainder, used as unshadowed irradiance
    rays_per_light : shadow rays towards each cap from each shading point
    """

    direction: NDArray[np.float64]
    irradiance: NDArray[np.float64]
    half_angle: NDArray[np.float64]
    ambient: EnvironmentMap
    rays_per_light: int = 16

    def __post_init__(self) -> None:
        for name, shape in (
            ("direction", (None, 3)),
            ("irradiance", (None, 3)),
            ("half_angle", (None,)),
        ):
            object.__setattr__(self, name, _checked(name, getattr(self, name), shape))
        _check_lights(self.direction, self.irradiance, self.half_angle, "half_angle")
        if len(self) and not (self.half_angle.min() > 0.0 and self.half_angle.max() <= np.pi / 2):
            raise EnvlightError("lighting: a half_angle lies outside (0, π/2]")
        if self.rays_per_light < 1:
            raise EnvlightError("lighting: rays_per_light must be at least 1")

    def __len__(self) -> int:
        return len(self.direction)

    def __repr__(self) -> str:
        return f"DiscLights({len(self)} discs, ambient {self.ambient!r})"

    def _repr_png_(self) -> bytes:
        return lights_thumbnail(self.direction, self.irradiance)


@dataclass(frozen=True, eq=False)
class LayeredLights:
    """Two global sets: `direct` at full resolution, `indirect` rendered small and upsampled.

    upsampling : factor between the two resolutions, a whole number, 1 for none
    guides : a pixel of several surfaces is upsampled by the means of their guides, "pixel", or once
        for each sub-pixel
    """

    direct: DirectionalLights
    indirect: DirectionalLights
    upsampling: int = 4
    guides: Literal["pixel", "subpixel"] = "pixel"

    def __post_init__(self) -> None:
        if self.upsampling < 1:
            raise EnvlightError(f"lighting: upsampling factor {self.upsampling}; use 1 or more")

    def _repr_png_(self) -> bytes:
        both = (self.direct, self.indirect)
        return lights_thumbnail(
            np.concatenate([lights.direction for lights in both]),
            np.concatenate([lights.irradiance for lights in both]),
        )


Lighting = DirectionalLights | LightDistribution | SurfaceDistribution | DiscLights | LayeredLights
