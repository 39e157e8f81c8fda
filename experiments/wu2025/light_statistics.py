"""Numbers about where a lighting's lights lie on its map.

A distribution has no lights of its own. Its count of draws, as one shading point takes them, stands
for them; its energy share comes from many more.
"""

import json
import math
from dataclasses import astuple
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.report.map_picture import circles
from samplers import (
    DirectionalLights,
    DiscLights,
    EnvironmentMap,
    LayeredLights,
    LightDistribution,
    Lighting,
    LightSampler,
    SurfaceDistribution,
)
from samplers.decomposition.emissive import classify
from samplers.environment import LUMINANCE_WEIGHTS
from samplers.sphere import pixel_directions, pixel_of_direction

DRAWS = 4096
FAR = 0.95
"""Quantile of the distances to the nearest light, by energy."""
CIRCLES = "circles"


def lights_row(environment: EnvironmentMap, sampler: LightSampler, count: int) -> dict[str, Any]:
    """The statistics of a sampler's lights at seed 0, and where they lie on a picture, as JSON."""
    lighting = sampler.prepare(environment, count, np.random.default_rng(0))
    drawn = [astuple(circle) for circle in circles(lighting)]
    return {**light_statistics(environment, lighting), CIRCLES: json.dumps(drawn)}


def light_statistics(environment: EnvironmentMap, lighting: Lighting) -> dict[str, Any]:
    """How many lights there are, and how they lie to the map's emissive region.

    lights, direct, indirect : numbers of lights; None where there are no such layers
    emissive_energy : the emissive region's part of the map's luminous energy
    energy_on_emissive : the part of the lights' energy whose lights lie on emissive texels
    direct_on_emissive : the same of the EnvDirects alone; None where there are none
    lights_on_emissive : the part of the lights that do
    emissive_degrees, emissive_degrees_far : mean and 95 % quantile, by energy, of the distance
        from an emissive texel to the nearest light; NaN without emissive texels
    sphere_degrees : the mean distance of any direction to the nearest light
    least_degrees : the smallest distance between two lights; NaN with fewer than two
    """
    direction, energy = _lights(lighting)
    emissive = classify(environment).emissive
    flux = environment.flux
    total = float(flux.sum(dtype=np.float64))
    on = emissive[pixel_of_direction(direction, environment.height)]
    sum_energy = float(energy.sum())
    layers = lighting if isinstance(lighting, LayeredLights) else None
    direct = slice(0, len(layers.direct) if layers else 0)
    sum_direct = float(energy[direct].sum())
    fixed = isinstance(lighting, (LayeredLights, DirectionalLights, DiscLights))
    near = direction if fixed else direction[: lighting.count]  # type: ignore[union-attr]
    return {
        "lights": len(near),
        "direct": len(layers.direct) if layers else None,
        "indirect": len(layers.indirect) if layers else None,
        "emissive_energy": float(flux[emissive].sum(dtype=np.float64)) / total if total else 0.0,
        "energy_on_emissive": float(energy[on].sum()) / sum_energy if sum_energy else 0.0,
        "direct_on_emissive": (
            float(energy[direct][on[direct]].sum()) / sum_direct if sum_direct else None
        ),
        "lights_on_emissive": float(on.mean()) if len(on) else 0.0,
        **_distances(environment, emissive, near),
        "least_degrees": _least(near),
    }


def _lights(lighting: Lighting) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Directions (n, 3) and luminous energy (n,)."""
    match lighting:
        case LayeredLights():
            layers = (lighting.direct, lighting.indirect)
            direction = np.concatenate([layer.direction for layer in layers])
            irradiance = np.concatenate([layer.irradiance for layer in layers])
        case DirectionalLights() | DiscLights():
            direction, irradiance = lighting.direction, lighting.irradiance
        case SurfaceDistribution():  # it has none without a surface
            return np.empty((0, 3)), np.empty(0)
        case LightDistribution():
            u = np.random.default_rng(0).random((DRAWS, 3), np.float32)
            drawn, pdf = lighting.sample(u)
            direction = drawn[pdf > 0.0].astype(np.float64)
            return direction, np.full(len(direction), 1.0)
    return np.asarray(direction, np.float64), irradiance @ LUMINANCE_WEIGHTS


def _distances(
    environment: EnvironmentMap, emissive: NDArray[np.bool_], lights: NDArray[np.float64]
) -> dict[str, float]:
    names = ("emissive_degrees", "emissive_degrees_far", "sphere_degrees")
    if not len(lights):
        return dict.fromkeys(names, math.nan)
    from scipy.spatial import cKDTree

    chord, _ = cKDTree(lights).query(pixel_directions(environment.height).reshape(-1, 3))
    angle = _degrees(chord).reshape(emissive.shape)
    solid_angle = np.broadcast_to(environment.row_solid_angle[:, None], emissive.shape)
    sphere = float(np.average(angle, weights=solid_angle))
    weight = environment.flux[emissive].astype(np.float64)
    if not weight.sum() > 0.0:
        return dict(zip(names, (math.nan, math.nan, sphere), strict=True))
    inside = angle[emissive]
    order = np.argsort(inside, kind="stable")
    running = np.cumsum(weight[order])
    far = inside[order][np.searchsorted(running, FAR * running[-1])]
    return dict(zip(names, (float(np.average(inside, weights=weight)), float(far), sphere),
                    strict=True))  # fmt: skip


def _least(lights: NDArray[np.float64]) -> float:
    if len(lights) < 2:
        return math.nan
    from scipy.spatial import cKDTree

    chord, _ = cKDTree(lights).query(lights, k=2)
    return float(_degrees(chord[:, 1]).min())


def _degrees(chord: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.degrees(2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)))
