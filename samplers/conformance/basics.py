"""The first of the checks, on which the others build: a sampler returns a lighting of good form.

What the kinds of lighting check of themselves, shapes, NaN, lengths and signs, they tell when they
are made; here it is their kind, and what a distribution gives back.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from samplers.base import LightSampler
from samplers.conformance.open_surface import OpenSurface, samples_of
from samplers.grids.tabulated import TabulatedDistribution
from samplers.lighting import (
    DirectionalLights,
    DiscLights,
    LayeredLights,
    LightDistribution,
    SurfaceDistribution,
    SurfaceSamples,
    TabulatedLight,
)

KINDS = "DirectionalLights, LayeredLights, DiscLights, a LightDistribution or a SurfaceDistribution"
DRAWS = 257
POINTS = 64


class Nonconformance(AssertionError):
    """A sampler does not do what every sampler must; the message says what was seen."""


def require(condition: bool, message: str) -> None:
    """Raise `Nonconformance` where the condition does not hold."""
    if not condition:
        raise Nonconformance(message)


def check_form(sampler: LightSampler, lighting: Any) -> None:
    """A frozen dataclass whose `prepare` returns one of the five kinds, with arrays as promised."""
    cls = type(sampler)
    own = "__dataclass_params__" in vars(cls)  # without it, new fields are no parameters
    require(own, f"class {cls.__name__} is not decorated with @dataclass(frozen=True)")
    if isinstance(lighting, DirectionalLights | DiscLights | LayeredLights):
        return
    if isinstance(lighting, SurfaceDistribution):
        _check_surface_form(lighting)
        return
    require(
        isinstance(lighting, LightDistribution), f"it returned {_described(lighting)}, not {KINDS}"
    )
    drawn = lighting.sample(np.random.default_rng(0).random((DRAWS, 3), np.float32))
    require(
        isinstance(drawn, tuple) and len(drawn) == 2,
        f"sample returned {_described(drawn)}, not (direction, pdf)",
    )
    direction, pdf = drawn
    _require_array("sample: direction", direction, (DRAWS, 3))
    _require_array("sample: pdf", pdf, (DRAWS,))
    length = np.linalg.norm(direction, axis=1)
    require(bool((length > 0.0).all()), "sample: a direction of length zero")
    off = float(np.abs(length - 1.0).max())
    require(off < 1e-5, f"sample: a direction that is off unit length by {off:.3g}")
    require(bool((pdf > 0.0).all()), f"sample: a pdf of {pdf.min():.3g}; it drew that direction")
    _require_array("pdf", lighting.pdf(np.ascontiguousarray(direction)), (DRAWS,))
    if isinstance(lighting, TabulatedLight):
        _check_table(lighting, direction, pdf)


def _check_table(
    lighting: TabulatedLight, direction: NDArray[np.float32], pdf: NDArray[np.float32]
) -> None:
    """The table, which the renderer draws from in place, gives what `sample` gives."""
    u = np.random.default_rng(0).random((DRAWS, 3), np.float32)
    drawn, density = TabulatedDistribution(
        lighting.weight, lighting.offset, lighting.table, lighting.count
    ).sample(u)
    same = np.array_equal(drawn, direction) and np.array_equal(density, pdf)
    require(same, "sample: it draws other directions or densities than its table does")


def _check_surface_form(lighting: SurfaceDistribution) -> None:
    """Samples of the promised shapes at a surface, of finite weight."""
    surface = OpenSurface.turned(POINTS)
    samples = samples_of(lighting, surface, np.random.default_rng(0))
    require(
        isinstance(samples, SurfaceSamples),
        f"sample_at returned {_described(samples)}, not SurfaceSamples",
    )
    number = len(samples.direction)
    require(0 < number <= lighting.count, f"{number} samples for a budget of {lighting.count}")
    _require_array("direction", samples.direction, (number, POINTS, 3))
    length = np.linalg.norm(samples.direction[np.asarray(samples.weight) > 0.0], axis=-1)
    off = float(np.abs(length - 1.0).max(initial=0.0))
    require(off < 1e-5, f"a direction that is off unit length by {off:.3g}")
    weight = np.asarray(samples.weight)
    require(weight.shape == (number, POINTS), f"weight has shape {weight.shape}")
    require(bool(np.isfinite(weight).all()), "weight holds NaN or infinity")
    require(bool((weight >= 0.0).all()), f"a weight of {weight.min():.3g}")
    if samples.radiance is not None:
        _require_array("radiance", samples.radiance, (number, POINTS, 3))


def _require_array(name: str, array: Any, shape: tuple[int, ...]) -> None:
    require(isinstance(array, np.ndarray), f"{name} is {_described(array)}, not an array")
    require(array.shape == shape, f"{name} has shape {array.shape}, not {shape}")
    require(array.dtype == np.float32, f"{name} is {array.dtype}, not float32")
    require(bool(np.isfinite(array).all()), f"{name} holds NaN or infinity")


def _described(value: Any) -> str:
    return "None" if value is None else f"a {type(value).__name__}"
