"""Rows of one budget from errors by sampler and map: all else is plain."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from experiments.report.rankings import Ranking, results
from metrics.registry import NEAR, ranked_metrics


def rows_of(
    errors: Mapping[str, Sequence[float] | np.ndarray],
    scenes: tuple[str, ...] = ("vase",),
    floor: float | Sequence[float] | np.ndarray = 1e-9,
    budget: str = "lights=4",
) -> pd.DataFrame:
    """One error per map by every ranked metric alike; the k-th scene has k times the error.

    floor : what the references' own noise gives, in all cases or by map"""
    rows = []
    for sampler, values in errors.items():
        floors = np.broadcast_to(floor, len(values))
        for k, error in enumerate(values):
            for place, scene in enumerate(scenes):
                value = (1 + place) * float(error)
                row = {
                    "scene": scene, "environment": f"map{k:02d}", "sampler": sampler,
                    "budget": budget, "seed": 0, "lights": 4, "count": 4, "rays_shadow": 10,
                    "rays_brdf": 0, "rays_primary": 5, "seconds_lights": 0.001,
                    "seconds_render": 0.1, "over_budget": False,
                }  # fmt: skip
                for metric in ranked_metrics():
                    row |= {
                        metric.name: value, metric.floor_column: floors[k],
                        metric.near_column: value < NEAR * floors[k],
                    }  # fmt: skip
                rows.append(row)
    return pd.DataFrame(rows)


def ranking_of(errors: Mapping[str, Sequence[float] | np.ndarray], **options) -> Ranking:
    """The ranking of such rows by the leading metric."""
    return results(rows_of(errors, **options))[0].rankings[0]
