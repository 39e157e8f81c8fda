"""Cases whose images can be compared: their pictures, and the numbers that stand beside them.

A `Case` is what the page of a scene under a map says. A run that is at hand has one for each; a
published run has those that `envlight publish --compare` put into its folder, as pictures and
`cases.json`, from which the same pages are made without the run.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import chain, zip_longest
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.maps.patterns import select
from experiments.report.pages.blocks import quoted, slug
from experiments.report.pages.pictures import (
    REFERENCE,
    STEEPNESS,
    WHITEST,
    CaseImages,
    Pictures,
    case_pictures,
    error_colors,
    mapped_metrics,
)
from experiments.report.style import Looks
from experiments.run.budget import opening_budget, sorted_budgets
from experiments.run.loaded_run import Run
from experiments.run.record import write_text
from metrics.registry import Metric, find_metric, metrics, ranked_metrics
from samplers import EnvlightError

FOLDER, INDEX = "compared", "cases.json"
WIDTH = 640
"""Wider images are reduced to so many columns where they are published, and stored without loss."""


@dataclass(frozen=True)
class Value:
    """A mean over seeds as text; near : whether any of them lies near its floor"""

    text: str
    near: bool


@dataclass(frozen=True)
class Method:
    """One sampler's line: means over seeds; pictures are of the first seed. values : by metric"""

    label: str
    values: dict[str, Value]
    rays: float
    seconds: float
    seeds: int
    pictures: Pictures | None


@dataclass(frozen=True)
class Case:
    """A scene under a map.

    size : columns and rows of the pictures; metrics : names of those that the rows hold
    floors : what the reference's own noise gives, as text by the metric's label
    budgets : by name, the samplers from the smallest error by the leading metric on
    """

    scene: str
    environment: str
    size: tuple[int, int]
    metrics: tuple[str, ...]
    floors: dict[str, str]
    reference: Pictures | None
    budgets: dict[str, tuple[Method, ...]]

    @property
    def file(self) -> str:
        return f"{slug(f'{self.scene}_{self.environment}')}.html"

    @property
    def title(self) -> str:
        return f"{self.scene} · {self.environment}"

    @property
    def thumbnail(self) -> str:
        return self.reference.thumbnail if self.reference else ""

    @property
    def shown(self) -> tuple[Metric, ...]:
        return tuple(map(find_metric, self.metrics))

    @property
    def samplers(self) -> set[str]:
        return {method.label for methods in self.budgets.values() for method in methods}

    @property
    def viewable(self) -> bool:
        """Whether there are pictures to compare."""
        return any(one.pictures for methods in self.budgets.values() for one in methods)

    def viewer(self, looks: Looks) -> dict[str, Any]:
        """What the viewer's script reads; links are relative to the page."""
        return {
            "width": self.size[0],
            "height": self.size[1],
            "steepness": STEEPNESS,
            "whitest": WHITEST,
            "colors": error_colors(),
            "errors": [{"name": m.name, "label": m.label} for m in mapped_metrics()],
            "reference": self.reference and f"../{quoted(self.reference.preview)}",
            "budgets": [
                {"name": name, "methods": [self._entry(method, looks) for method in methods]}
                for name, methods in self.budgets.items()
            ],
        }

    def _entry(self, method: Method, looks: Looks) -> dict[str, Any]:
        pictures = method.pictures
        ranked = reversed([metric for metric in self.shown if metric.ranked])
        return {
            "name": method.label,
            "color": looks[method.label].color,
            "values": [f"{m.label} {method.values[m.name].text}" for m in ranked],
            "image": pictures and f"../{quoted(pictures.preview)}",
            "errors": {
                name: f"../{quoted(file)}"
                for name, file in (pictures.errors if pictures else {}).items()
            },
        }


def names_in_order(rows: pd.DataFrame) -> list[tuple[str, str]]:
    """Scene and map of all cases: the first scene under every map, then the second, and so on."""
    scenes = [
        [(str(scene), str(name)) for scene in sorted(part["scene"].unique())]
        for name, part in rows.groupby("environment", sort=True)
    ]
    return [case for case in chain.from_iterable(zip_longest(*scenes)) if case is not None]


def images_of(run: Run, rows: pd.DataFrame, linked: bool = True) -> CaseImages:
    """The kept images of the first seeds of a case's rows; none may be there."""
    first = rows.groupby(["sampler", "budget"])["seed"].transform("min")
    images = {
        str(row["key"]): path
        for _, row in rows[rows["seed"] == first].iterrows()
        if (path := run.kept_image(row)) is not None
    }
    reference = run.kept_reference(rows.iloc[0])
    return CaseImages(run.folder, images, reference, float(rows["exposure"].iloc[0]), linked)


def case_of(run: Run, rows: pd.DataFrame, pictures: dict[str, Pictures], width: int) -> Case:
    """What the page of a case says. pictures : by key; width : of the widest"""
    first, scale = rows.iloc[0], run.record["scale"]
    size = (scale["width"], scale["height"])
    if 0 < width < size[0]:
        size = (width, max(1, round(size[1] * width / size[0])))
    present = [metric for metric in metrics() if metric.name in rows]
    return Case(
        str(first["scene"]),
        str(first["environment"]),
        size,
        tuple(metric.name for metric in present),
        {
            metric.label: f"{first[metric.floor_column]:.2g}"
            for metric in present
            if metric.floor_column in rows and pd.notna(first[metric.floor_column])
        },
        pictures.get(REFERENCE),
        {
            budget: _methods(rows[rows["budget"] == budget], present, pictures)
            for budget in sorted_budgets(list(rows["budget"].unique()))
        },
    )


def _methods(
    rows: pd.DataFrame, present: Sequence[Metric], pictures: dict[str, Pictures]
) -> tuple[Method, ...]:
    """The samplers of one budget, the smallest error first."""
    ranked = [metric.name for metric in reversed(ranked_metrics()) if metric.name in rows]
    order = rows.groupby("sampler", sort=True)[ranked].mean().sort_values(ranked, kind="stable")
    found = []
    for label in map(str, order.index):
        part = rows[rows["sampler"] == label].sort_values("seed")
        rays = (part["rays_shadow"] + part["rays_brdf"]) / part["rays_primary"]
        values = {
            metric.name: Value(
                f"{part[metric.name].mean():.{metric.digits}f}",
                metric.near_column in part and bool(part[metric.near_column].any()),
            )
            for metric in present
        }
        seconds = part["seconds_lights"] + part["seconds_render"]
        shown = pictures.get(str(part["key"].iloc[0]))
        found.append(
            Method(label, values, float(rays.mean()), float(seconds.mean()), len(part), shown)
        )
    return tuple(found)


def publish_compared(folder: Path, target: Path, patterns: Sequence[str]) -> list[Path]:
    """Write pictures and pages of a run's cases into a published folder; returns the files.

    patterns : of maps' names, or of scene and map as in "vase_noon-desert"

    Raises EnvlightError where no images are kept, or a pattern matches no case.
    """
    run = Run.load(folder)
    at = run.at(opening_budget(run.rows["budget"]))
    kept = [run.kept_image(row) is not None for _, row in at.iterrows()]
    if not any(kept):
        raise EnvlightError(f"{folder}: no images are kept there; run it without --no-images")
    at = at[kept]
    names = {case: {case[1], f"{case[0]}_{case[1]}"} for case in names_in_order(at)}
    asked = set(select(sorted(set().union(*names.values())), list(patterns), "case"))
    place, found = target / FOLDER, []
    for scene, environment in sorted(case for case in names if names[case] & asked):
        rows = at[(at["scene"] == scene) & (at["environment"] == environment)]
        made, wrong = case_pictures(images_of(run, rows, False), place, place, WIDTH)
        if wrong:
            raise EnvlightError(wrong[0])
        found.append(case_of(run, rows, made, WIDTH))
    text = json.dumps([asdict(case) for case in found], indent=1, ensure_ascii=False)
    write_text(place / INDEX, text + "\n")
    return sorted(file for file in place.rglob("*") if file.is_file())


def read_compared(folder: Path) -> list[Case]:
    """The cases of such a folder; EnvlightError where it is damaged."""
    try:
        return list(_cases(json.loads((folder / INDEX).read_text(encoding="utf-8"))))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise EnvlightError(
            f"{folder / INDEX}: it cannot be read ({error}); publish the run again"
        ) from error


def _cases(found: list[dict[str, Any]]) -> Iterator[Case]:
    """Cases from JSON; what it has besides is left out."""

    def pictures(one: dict[str, Any] | None) -> Pictures | None:
        return Pictures(**one) if one else None

    def method(one: dict[str, Any]) -> Method:
        values = {name: Value(**value) for name, value in one["values"].items()}
        shown, costs = pictures(one["pictures"]), (one["rays"], one["seconds"])
        return Method(one["label"], values, *costs, one["seeds"], shown)

    for one in found:
        budgets = {name: tuple(map(method, many)) for name, many in one["budgets"].items()}
        named = (one["scene"], one["environment"], tuple(one["size"]), tuple(one["metrics"]))
        yield Case(*named, one["floors"], pictures(one["reference"]), budgets)
