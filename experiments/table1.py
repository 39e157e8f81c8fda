"""Mean error and mean rank of every sampler over all maps and scenes.

Reproduces Table 1 of Wu, "Efficient environment map rendering based on decomposition", 2025: RMSE
and FLIP averaged over maps and scenes, and the rank of each method per map, averaged over maps. A
map's error is the mean over its scenes, a scene's the mean over seeds; equal errors share the
better rank. Only blocks (scene × map) on which every sampler has all its seeds are compared, so
that neither an unfinished run nor a failed cell favours anyone.
"""

from dataclasses import dataclass

import pandas as pd

from experiments.cell import Block, Budget, Cell, SamplerSpec
from experiments.datasets import EnvironmentSource
from experiments.scale import Scale
from metrics.ranking import mean_ranks

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
ERRORS = ("rmse", "flip")
COSTS = ("lights", "rays", "seconds_lights", "seconds_render")


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
            for environment in self.environments
            for scene in self.scenes
            for budget in self.budgets
            for sampler in self.samplers
            for seed in range(self.seeds if sampler.sampler.stochastic else 1)
            if budget.lights >= sampler.sampler.minimum_count
        ]

    def left_out(self) -> list[str]:
        """Sentences about samplers that cannot meet a budget, and so have no cell at it."""
        return [
            f"{sampler.label} needs at least {sampler.sampler.minimum_count} lights and is left "
            f"out at {budget}"
            for budget in self.budgets
            for sampler in self.samplers
            if budget.lights < sampler.sampler.minimum_count
        ]


def compared(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows of one budget that lie in blocks on which every sampler has all its seeds.

    How many seeds a sampler has is the most that it has on any block.
    """
    block = ["scene", "environment"]
    seeds = rows.groupby([*block, "sampler"]).size().unstack("sampler")
    complete = (seeds == seeds.max()).all(axis=1)
    return rows[complete.reindex(pd.MultiIndex.from_frame(rows[block])).to_numpy()]


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """One line per sampler and budget, best mean FLIP rank first within a budget.

    All figures are means over the compared blocks, NaN where there is none; `maps` and `blocks`
    say how many those are.
    """
    lights = rows["budget"].str.extract(r"(\d+)", expand=False).astype(int)
    return pd.concat([_at_budget(part) for _, part in rows.groupby(lights)], ignore_index=True)


def _at_budget(rows: pd.DataFrame) -> pd.DataFrame:
    fair = compared(rows)
    names = pd.Index(sorted(rows["sampler"].unique()), name="sampler")
    table = pd.DataFrame({"budget": rows["budget"].iloc[0]}, index=names)
    per_scene = fair.groupby(["environment", "scene", "sampler"])[list(ERRORS)].mean()
    per_map = per_scene.groupby(level=["environment", "sampler"]).mean()
    for error in ERRORS:
        by_sampler = per_map[error].unstack("sampler").reindex(names, axis="columns")
        table[error] = by_sampler.mean()
        table[f"{error}_rank"] = mean_ranks(by_sampler) if len(by_sampler) else float("nan")
    costs = fair.assign(rays=(fair["rays_shadow"] + fair["rays_brdf"]) / fair["rays_primary"])
    table[list(COSTS)] = costs.groupby("sampler")[list(COSTS)].mean()
    table["maps"] = fair["environment"].nunique()
    table["blocks"] = len(fair.groupby(["scene", "environment"]))
    table["near_floor"] = fair.groupby("sampler")["near_noise_floor"].sum()
    table = table.reset_index()[["budget", "sampler", *table.columns[1:]]]
    return table.sort_values(["flip_rank", "rmse_rank", "sampler"], kind="stable")
