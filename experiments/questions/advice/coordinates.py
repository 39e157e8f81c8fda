"""A map as a point: what a model of errors sees of its features.

Shares become log-odds, counts, ratios and angles logarithms, so that a step is a factor. Each
coordinate is in units of its spread over the maps that were measured, and none counts as further
out than the furthest of those: a model knows nothing beyond them.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.maps.features import FEATURES, PREFIX

Array = NDArray[np.float64]
LEAST_SHARE = 1e-3
"""Shares nearer to 0 or 1 count as so near."""


def plain(features: Mapping[str, float]) -> Array:
    """The features of a map (f,), in their order, from columns such as `map_contrast`."""
    return np.array([features[PREFIX + name] for name in FEATURES])


def transformed(features: Array) -> Array:
    """Features (…, f) as log-odds, logarithms, or as they are."""
    found = np.array(features, np.float64)
    for k, feature in enumerate(FEATURES.values()):
        value = found[..., k]
        match feature.unit:
            case "share":
                inside = np.clip(value, LEAST_SHARE, 1.0 - LEAST_SHARE)
                found[..., k] = np.log(inside / (1.0 - inside))
            case "count":
                found[..., k] = np.log1p(value)
            case "degrees" | "ratio":
                found[..., k] = np.log(np.maximum(value, 1e-30))
    return found


@dataclass(frozen=True, eq=False)
class Frame:
    """Where the measured maps lie. centre, spread, low, high : (f,), of `transformed`"""

    centre: Array
    spread: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, features: Array) -> "Frame":
        """Of the features (m, f) of maps; a feature that is the same for all counts for nothing."""
        found = transformed(features)
        spread = found.std(axis=0)
        return cls(
            found.mean(axis=0),
            np.where(spread > 1e-9, spread, math.inf),
            found.min(0),
            found.max(0),
        )

    def point(self, features: Array) -> Array:
        """Coordinates (…, f) of features, none beyond those of the measured maps."""
        inside = np.clip(transformed(features), self.low, self.high)
        return (inside - self.centre) / self.spread
