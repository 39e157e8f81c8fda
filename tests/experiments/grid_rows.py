"""Rows of grid experiments made by hand: errors are given, all else is plain."""

from collections.abc import Callable
from pathlib import Path

import pandas as pd

from experiments.run.loaded_run import Run

Errors = Callable[[str, str, str, int], tuple[float, float]]
"""RMSE and FLIP from scene, map, sampler and number of lights."""


def grid_run(
    folder: Path,
    scenes: tuple[str, ...],
    maps: tuple[str, ...],
    samplers: tuple[str, ...],
    errors: Errors,
    lights: tuple[int, ...] = (16,),
    near_floor: Callable[[float], bool] = lambda rmse: False,
) -> Run:
    """A finished run whose rays and seconds are proportional to the lights."""
    rows = []
    for environment in maps:
        for scene in scenes:
            for count in lights:
                for place, sampler in enumerate(samplers):
                    rmse, flip = errors(scene, environment, sampler, count)
                    rows.append(
                        {
                            "key": f"{len(rows):024d}", "reference": f"{scene}-{environment}",
                            "scene": scene, "environment": environment, "sampler": sampler,
                            "budget": f"lights={count}", "seed": 0, "scale": "quick",
                            "repaired": 0, "count": count, "lights": count, "over_budget": False,
                            "rays": float(count),
                            "rmse": rmse, "rmse_measured": rmse, "flip": flip, "exposure": 1.0,
                            "rmse_floor": 0.001, "rmse_near_floor": near_floor(rmse),
                            "flip_floor": 0.001, "flip_near_floor": False,
                            "rays_primary": 100, "rays_shadow": 100 * count, "rays_brdf": 0,
                            "rays_skipped": 0, "seconds_lights": 0.002 * (1 + place),
                            "seconds_render": 0.001 * count,
                        }
                    )  # fmt: skip
    return Run(
        folder,
        pd.DataFrame(rows),
        {
            "experiment": "test",
            "scale": {"name": "quick", "width": 112, "height": 84, "subpixels": 4},
            "samplers": list(samplers),
            "budgets": [f"lights={count}" for count in lights],
            "planned": len(rows),
            "missing": {},
            "machine": {
                "processor": "a processor", "cores": 2, "threads": 2, "python": "3",
                "commit": "", "command": "envlight run test",
            },
        },
    )  # fmt: skip


def contents(folder: Path) -> dict[str, bytes]:
    """All files below a folder by their name there."""
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in sorted(folder.rglob("*"))
        if file.is_file()
    }
