"""Where each method puts its lights: the map's emissive region and the lights, side by side.

Reproduces Fig. 4 and 5 of Wu, "Efficient environment map rendering based on decomposition", 2025:
a picture per map, first its emissive (red) and non-emissive (blue) texels, then every method's
lights as circles, EnvIndirects and draws in colours of their own; and a table of how the lights lie
to the emissive region. Paper and supplement print no such numbers, so none stand beside these.

Seed 0. Embedded maps at scale quick: one or two of every kind, chosen by kind alone; --maps '*'
takes all. All samplers but ours-no-upsampling, whose lights are those of ours; --samplers chooses.
"""

import json
from collections.abc import Sequence
from dataclasses import astuple
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from experiments.maps.classes import representatives
from experiments.maps.patterns import select
from experiments.maps.sources import EMBEDDED, EnvironmentSource, find_environments
from experiments.report.map_picture import Circle, circles
from experiments.run.budget import Budget
from experiments.run.request import RunRequest
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import find_scale
from experiments.run.study import Group, Job, Row, Study, run_study
from experiments.wu2025.light_statistics import light_statistics
from samplers import sampler_names

NAME = "light-distribution"
TITLE = "Lights and the emissive region (Wu 2025, Fig. 4 and 5)"
COUNT = 16
SAME_LIGHTS = "ours-no-upsampling"
CIRCLES = "circles"
FORMATS = {
    "environment": "s", "sampler": "s", "count": "d", "lights": "d", "direct": ".0f",
    "indirect": ".0f", "emissive_energy": ".3f", "energy_on_emissive": ".3f",
    "lights_on_emissive": ".3f", "emissive_degrees": ".2f", "emissive_degrees_far": ".2f",
    "sphere_degrees": ".1f", "least_degrees": ".2f",
}  # fmt: skip
NOTES = [
    "`emissive_energy` is the emissive region's part of the map's energy; `energy_on_emissive` and "
    "`lights_on_emissive` are the parts of the lights' energy and number that lie on it. "
    "`emissive_degrees` (mean) and `emissive_degrees_far` (95 % quantile), both by energy, are the "
    "distances from emissive texels to the nearest light, `sphere_degrees` the mean distance of "
    "any direction, `least_degrees` the smallest between two lights. For distributions, as many "
    "draws as lights stand for them; their energy share is of 4096 draws.",
]


def run(request: RunRequest, dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    scale = find_scale(request.scale)
    patterns = request.maps
    if not patterns and request.environments == EMBEDDED and request.scale == "quick":
        patterns = representatives(2)
    sources = find_environments(request.environments, patterns, scale.map_height, request.repair)
    names = [name for name in sampler_names() if name != SAME_LIGHTS or request.samplers]
    specs = [SamplerSpec(name) for name in select(names, request.samplers, "sampler")]
    counts = [Budget.parse(text).lights for text in request.budgets] or [COUNT]
    groups = [_group(source, specs, counts) for source in sources]
    modules = ("experiments.wu2025.light_statistics", "experiments.report.map_picture")
    draw = partial(report, {source.name: source for source in sources})
    return run_study(Study(NAME, modules, groups, draw, timed=False), request, dry_run)


def _group(source: EnvironmentSource, specs: list[SamplerSpec], counts: list[int]) -> Group:
    work = {
        f"{spec.label} at {count}": (spec, count)
        for spec in specs
        for count in counts
        if count >= spec.sampler.minimum_count
    }
    jobs = {
        name: Job(
            {"environment": source.name, "sampler": spec.label, "count": count},
            {"map": source.identity, "sampler": spec.identity},
        )
        for name, (spec, count) in work.items()
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        environment = source.load()
        rows: dict[str, Row] = {}
        for name in names:
            spec, count = work[name]
            lighting = spec.sampler.prepare(environment, count, np.random.default_rng(0))
            rows[name] = {
                **light_statistics(environment, lighting),
                CIRCLES: json.dumps([astuple(circle) for circle in circles(lighting)]),
            }
        return rows

    return Group(source.name, jobs, measure)


def report(sources: dict[str, EnvironmentSource], rows: pd.DataFrame, folder: Path) -> list[Path]:
    """The table, and a picture per map and number of lights."""
    from experiments.report.frames import present

    files = present(folder, NAME, rows.drop(columns=CIRCLES), FORMATS, TITLE, NOTES)
    for (name, count), part in rows.groupby(["environment", "count"], sort=False):
        path = folder / "maps" / f"{name}_lights={count}.jpg"
        _draw(path, sources[str(name)], part)
        files.append(path)
    return files


def _draw(path: Path, source: EnvironmentSource, rows: pd.DataFrame) -> None:
    from experiments.report.map_picture import draw_circles, draw_regions, halved
    from experiments.report.preview import contact_sheet
    from renderer.image import write_jpeg

    environment = source.load()
    pictures = [(f"{source.name}: emissive red, other blue", halved(draw_regions(environment)))]
    for _, row in rows.iterrows():
        drawn = draw_circles(environment, [Circle(*values) for values in json.loads(row[CIRCLES])])
        share = f"{100.0 * row['energy_on_emissive']:.0f} % of energy on emissive"
        pictures.append((f"{row['sampler']}: {row['lights']} lights, {share}", halved(drawn)))
    write_jpeg(path, contact_sheet(pictures, 3))
