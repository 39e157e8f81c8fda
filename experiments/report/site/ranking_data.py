"""The rows behind the ranking of the first page, as its scripts read them.

Per budget and metric a table cases × samplers of means over seeds, and what the references' own
noise gives by case; with them the number of seeds, and what an image took. Tables are packed as
base64 of little-endian numbers, errors with all their bits, so that ranks and ties come out as they
do here. Bootstraps begin with the state of the same generator.
"""

import base64
import json
from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.report.rankings import BASELINE, LEVEL, SEED
from experiments.report.run_data import slug
from experiments.report.site.publications import Publication
from experiments.report.style import Look
from experiments.report.summary import compared, errors_in, floors_per_case, timed_alike
from experiments.run.budget import sorted_budgets
from experiments.run.sampler_spec import family_of
from metrics.ranking import CONFIDENCE, RESAMPLES
from metrics.registry import NEAR, find_metric, leading_metric, ranked_metrics

CASE = ["scene", "environment"]
WORDS = 2**32


def constants() -> dict[str, Any]:
    """What the statistics of the page share with those of the reports."""
    state = np.random.default_rng(SEED).bit_generator.state["state"]
    return {
        "near": NEAR,
        "level": LEVEL,
        "baseline": BASELINE,
        "resamples": RESAMPLES,
        "confidence": CONFIDENCE,
        "leading": leading_metric().name,
        "metrics": {one.name: [one.label, one.digits] for one in ranked_metrics()},
        "state": _words(state["state"]),
        "increment": _words(state["inc"]),
    }


def _words(number: int) -> list[int]:
    """A number of 128 bits as four of 32, the lowest first."""
    return [number >> (32 * k) & (WORDS - 1) for k in range(4)]


def entry(one: Publication) -> dict[str, Any]:
    """What the page knows of a run before its rows are read."""
    rows = one.run.rows
    width, height = one.size
    return {
        "name": one.name,
        "file": f"data/{slug(one.name)}.js",
        "title": one.title,
        "size": f"{width}×{height}",
        "pixels": width * height,
        "budgets": sorted_budgets([str(budget) for budget in rows["budget"].unique()]),
        "maps": int(rows["environment"].nunique()),
        "samplers": int(rows["sampler"].nunique()),
        "scenes": int(rows["scene"].nunique()),
    }


def script(one: Publication, looks: dict[str, Look], leagues: dict[str, str]) -> str:
    """The rows of a run as a script that hands them to the page."""
    text = json.dumps(dataset(one, looks, leagues), ensure_ascii=False, separators=(",", ":"))
    return f"envlight.add({text});\n"


def dataset(one: Publication, looks: dict[str, Look], leagues: dict[str, str]) -> dict[str, Any]:
    """The rows of a run; samplers, maps and scenes by name, so that pages order as tables do."""
    rows = one.run.rows
    samplers = sorted(map(str, rows["sampler"].unique()))
    maps = sorted(map(str, rows["environment"].unique()))
    scenes = sorted(map(str, rows["scene"].unique()))
    cases = sorted(set(rows[CASE].itertuples(index=False, name=None)))
    index = pd.MultiIndex.from_tuples(cases, names=CASE)
    return {
        "name": one.name,
        "samplers": samplers,
        "pages": [slug(family_of(name)) for name in samplers],
        "colors": [looks[name].color for name in samplers],
        "leagues": [leagues.get(name, "") for name in samplers],
        "maps": maps,
        "classes": [one.classes[name] for name in maps],
        "scenes": scenes,
        "cases": [[scenes.index(scene), maps.index(name)] for scene, name in cases],
        "budgets": [
            _budget(str(budget), rows[rows["budget"] == budget], index, samplers)
            for budget in sorted_budgets(list(rows["budget"].unique()))
        ],
    }


def _budget(
    name: str, rows: pd.DataFrame, cases: pd.MultiIndex, samplers: Iterable[str]
) -> dict[str, Any]:
    def wide(values: pd.Series, table: pd.DataFrame = rows) -> NDArray[np.float64]:
        """Means over seeds, cases × samplers; NaN where there is no row."""
        means = values.groupby([table[column] for column in (*CASE, "sampler")]).mean()
        return means.unstack("sampler").reindex(index=cases, columns=list(samplers)).to_numpy()

    counts = rows.groupby([*CASE, "sampler"]).size().unstack("sampler")
    counts = counts.reindex(index=cases, columns=list(samplers)).fillna(0)
    timed = timed_alike(compared(rows))
    return {
        "name": name,
        "counts": _packed(counts.to_numpy(), "u1"),
        "metrics": {
            metric: {
                "errors": _packed(wide(rows[metric]), "<f8"),
                "floors": _packed(
                    floors_per_case(rows, find_metric(metric)).reindex(cases).to_numpy(), "<f8"
                ),
            }
            for metric in errors_in(rows)
        },
        "costs": {
            "lights": _packed(wide(rows["lights"]), "<f4"),
            "rays": _packed(
                wide((rows["rays_shadow"] + rows["rays_brdf"]) / rows["rays_primary"]), "<f4"
            ),
            "seconds": _packed(
                wide(timed["seconds_lights"] + timed["seconds_render"], timed), "<f4"
            ),
        },
    }


def _packed(values: NDArray, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values, kind).tobytes()).decode("ascii")
