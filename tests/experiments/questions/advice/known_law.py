"""Rows of a run in which errors follow a known law of two features of the maps."""

from pathlib import Path

import numpy as np
import pandas as pd

from experiments.maps.features import FEATURES, PREFIX
from experiments.run.loaded_run import Run

COUNTS = (4, 8, 16, 32)
SAMPLERS = {"ours": "layers", "median-cut": "fixed lights", "mis": "distribution"}
RAYS_PER_LIGHT = {"ours": 0.25, "median-cut": 0.5, "mis": 0.75}
SIZE = (112, 84, 4)


VARIED = ("emitter_size", "texture")
"""What errors depend on; nothing else differs between the maps."""


def features_of(rng: np.random.Generator) -> dict[str, float]:
    """Features of a map that does not exist, those that vary of the kind and range of their own."""
    found = {}
    for name, feature in FEATURES.items():
        if name not in VARIED:
            found[name] = 0.5
            continue
        match feature.unit:
            case "share":
                found[name] = float(rng.uniform(0.05, 0.95))
            case "count":
                found[name] = float(rng.integers(1, 60))
            case "degrees" | "ratio":
                found[name] = float(10.0 ** rng.uniform(0.0, 3.0))
            case _:
                found[name] = float(rng.normal())
    return found


def law(sampler: str, features: dict[str, float], count: int) -> float:
    """Errors: "ours" gains by large emitters, "mis" loses by texture, all fall with the count."""
    size, texture = np.log(features["emitter_size"]), features["texture"]
    slope, large, rough = {
        "ours": (-0.5, -0.3, 0.0), "median-cut": (-0.6, 0.0, 0.0), "mis": (-0.7, 0.0, 0.3),
    }[sampler]  # fmt: skip
    start = {"ours": 0.2, "median-cut": -1.0, "mis": -0.8}[sampler]
    return float(np.exp(start + slope * np.log2(count / 4) + large * size + rough * texture))


def law_run(folder: Path, maps: int = 40, noise: float = 0.0, seed: int = 0) -> Run:
    """A run over so many maps and two scenes, on which errors are 0.8 and 1.2 times the law."""
    rng = np.random.default_rng(seed)
    rows = []
    for number in range(maps):
        features = features_of(rng)
        for sampler, league in SAMPLERS.items():
            for count in COUNTS:
                error = law(sampler, features, count) * np.exp(noise * rng.normal())
                for scene, factor in (("rubiks-cube", 0.8), ("vase", 1.2)):
                    rays = RAYS_PER_LIGHT[sampler] * count
                    rows.append(
                        {
                            "scene": scene, "environment": f"map-{number:02d}", "sampler": sampler,
                            "budget": f"lights={count}", "seed": 0, "scale": "quick",
                            "league": league, "count": count, "lights": count, "rays": rays,
                            "rays_primary": 1000, "rays_shadow": int(1000 * rays), "rays_brdf": 0,
                            "rmse": factor * error, "rmse_floor": 0.0, "rmse_near_floor": False,
                            "flip": factor * error**0.5, "flip_floor": 0.0,
                            "flip_near_floor": False, "over_budget": False,
                            "seconds_lights": 0.01 * count,
                            "seconds_render": 1000 * rays * (2e-8 if sampler == "mis" else 1e-8),
                            **{PREFIX + name: value for name, value in features.items()},
                        }
                    )  # fmt: skip
    record = {
        "experiment": "which-sampler",
        "scale": {"name": "quick", "width": SIZE[0], "height": SIZE[1], "subpixels": SIZE[2]},
        "samplers": list(SAMPLERS), "budgets": [f"lights={count}" for count in COUNTS],
        "planned": len(rows), "missing": {},
        "machine": {
            "processor": "a processor", "cores": 2, "threads": 2, "python": "3", "commit": "abc",
            "command": "envlight run which-sampler",
        },
    }  # fmt: skip
    return Run(folder, pd.DataFrame(rows), record)
