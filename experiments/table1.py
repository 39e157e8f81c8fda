"""Mean error and mean rank of every sampler over all maps and scenes.

Reproduces Table 1 of Wu, "Efficient environment map rendering based on decomposition", 2025: RMSE
and FLIP averaged over maps and scenes, and the rank of each method per map, averaged over maps. A
map's error is the mean over its scenes and seeds; equal errors share the better rank.
"""

from dataclasses import dataclass

import pandas as pd

from experiments.cell import Block, Budget, Cell, SamplerSpec
from experiments.datasets import EnvironmentSource
from experiments.scale import Scale

NAME = "table1"
STOCHASTIC_SEEDS = 3
TEST_SCENES = ("rubiks-cube", "vase")
PAPER = {
    "mis": (0.1579, 6.00, 0.1212, 2.81),
    "fhis": (0.1572, 5.63, 0.2217, 6.19),
    "median-cut": (0.0881, 4.16, 0.1819, 5.16),
    "variance-minimization": (0.1035, 4.88, 0.1546, 4.22),
    "tmms": (0.0886, 4.00, 0.1895, 5.72),
    "ours-no-upsampling": (0.0579, 2.16, 0.1191, 2.81),
    "ours": (0.0438, 1.16, 0.0865, 1.06),
}
"""RMSE, its rank, FLIP, its rank, as printed in the paper's Table 1."""


@dataclass(frozen=True)
class Grid:
    """What is compared: every combination of these, at one scale."""

    scenes: tuple[str, ...]
    environments: tuple[EnvironmentSource, ...]
    samplers: tuple[SamplerSpec, ...]
    budgets: tuple[Budget, ...]
    scale: Scale
    seeds: int = STOCHASTIC_SEEDS

    def cells(self) -> list[Cell]:
        """All cells, those of a block together. Only stochastic samplers get several seeds."""
        return [
            Cell(Block(scene, environment, self.scale), sampler, budget, seed)
            for scene in self.scenes
            for environment in self.environments
            for budget in self.budgets
            for sampler in self.samplers
            for seed in range(self.seeds if sampler.sampler.stochastic else 1)
            if budget.lights >= sampler.sampler.minimum_count
        ]


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """One line per sampler and budget, best mean FLIP rank first within a budget."""
    keys = ["budget", "environment", "sampler"]
    per_scene = rows.groupby([*keys, "scene"], sort=True)[["rmse", "flip"]].mean()
    per_map = per_scene.groupby(level=keys).mean()
    ranks = per_map.groupby(level=["budget", "environment"]).rank(method="min")
    table = per_map.groupby(level=["budget", "sampler"]).mean()
    table[["rmse_rank", "flip_rank"]] = ranks.groupby(level=["budget", "sampler"]).mean()
    costs = rows.assign(rays=rows["rays_shadow"] + rows["rays_brdf"])
    costs["rays"] /= costs["rays_primary"]
    table[["lights", "rays", "seconds_lights", "seconds_render"]] = costs.groupby(
        ["budget", "sampler"]
    )[["lights", "rays", "seconds_lights", "seconds_render"]].mean()
    table["maps"] = per_map.groupby(level=["budget", "sampler"]).size()
    table["near_floor"] = rows.groupby(["budget", "sampler"])["near_noise_floor"].sum()
    table = table.reset_index()
    table["order"] = table["budget"].str.extract(r"(\d+)", expand=False).astype(int)
    table = table.sort_values(["order", "flip_rank", "rmse_rank", "sampler"], kind="stable")
    return table.drop(columns="order").reset_index(drop=True)
