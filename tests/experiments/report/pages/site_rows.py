"""Rows made so that ranks are hard, under names that pages have to escape."""

import numpy as np
import pandas as pd

from tests.experiments.report.ranking_rows import rows_of

TINY, HARD = "tiny", "hard & <b>strange"
MAPS = (
    "dikhololo_night", "moonless_golf_1k", "neuer_zollhof", "red_wall", "noon_grass", "comfy_cafe",
    "my own map", "potsdamer_platz",
)  # fmt: skip
FLOOR = 0.01


def hard_rows() -> pd.DataFrame:
    """Two budgets, errors near the floor, equal ones, and a case that one has not finished."""
    rng = np.random.default_rng(7)
    parts = []
    for budget, scale in (("lights=16", 1.0), ("rays=4", 0.4)):
        errors = {
            name: scale * factor * np.exp(0.4 * rng.standard_normal(len(MAPS)))
            for name, factor in (
                ("median-cut", 0.1), ("ours", 0.06), ("mis", 0.05), ("mis-compensated", 0.045),
                ("uniform", 0.2),
            )
        }  # fmt: skip
        errors["mis[numbers=independent]"] = errors["mis"].copy()
        rows = rows_of(errors, scenes=("vase", "teapot"), floor=FLOOR, budget=budget)
        # By the two metrics the order is not the same.
        rows["flip"] = rows["flip"] ** 0.8 * (1.0 + 0.1 * rng.random(len(rows)))
        parts.append(rows)
    rows = pd.concat(parts, ignore_index=True)
    rows["environment"] = [MAPS[int(name.removeprefix("map"))] for name in rows["environment"]]
    missing = (rows["environment"] == "red_wall") & (rows["scene"] == "vase")
    return rows[~(missing & (rows["sampler"] == "ours"))].reset_index(drop=True)
