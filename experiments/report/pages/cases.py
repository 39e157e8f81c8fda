"""Cases whose images can be compared: their pictures, and the numbers that stand beside them.

A run that is at hand has a page for each scene under a map; a published one for those whose
pictures `envlight publish --compare` put into its folder. The numbers are those of its rows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd
from markupsafe import Markup

from experiments.maps.patterns import select
from experiments.report.pages.markdown import quoted, slug, table_html
from experiments.report.pages.pictures import (
    ERRORS,
    PREVIEWS,
    REFERENCE,
    STEEPNESS,
    WHITEST,
    Pictures,
    case_pictures,
    error_colors,
    mapped_metrics,
)
from experiments.report.parts import Table
from experiments.report.style import Looks, label_of
from experiments.run.budget import opening_budget, sorted_budgets
from experiments.run.loaded_run import Run
from metrics.registry import Metric, metrics, ranked_metrics
from samplers import EnvlightError

FOLDER = "compared"
WIDTH = 640
"""Wider images are reduced to so many columns where they are published, and stored without loss."""
CASE = ["scene", "environment"]


@dataclass(frozen=True, eq=False)
class Case:
    """A scene under a map.

    rows : its measurements
    size : columns and rows of the pictures
    pictures : by the keys of measurements, that of the reference under "reference"
    """

    rows: pd.DataFrame
    size: tuple[int, int]
    pictures: dict[str, Pictures]

    @property
    def scene(self) -> str:
        return str(self.rows["scene"].iloc[0])

    @property
    def environment(self) -> str:
        return str(self.rows["environment"].iloc[0])

    @property
    def file(self) -> str:
        return f"{slug(f'{self.scene}_{self.environment}')}.html"

    @property
    def title(self) -> str:
        return f"{self.scene} · {self.environment}"

    @property
    def thumbnail(self) -> str:
        return self.pictures[REFERENCE].thumbnail if REFERENCE in self.pictures else ""

    @property
    def samplers(self) -> set[str]:
        return set(map(str, self.rows["sampler"]))

    @property
    def viewable(self) -> bool:
        """Whether there are pictures to compare."""
        return bool(self.pictures.keys() - {REFERENCE})

    @property
    def present(self) -> list[Metric]:
        return [metric for metric in metrics() if metric.name in self.rows]

    @property
    def floors(self) -> str:
        """What the reference's own noise gives, by metric."""
        first = self.rows.iloc[0]
        known = [one for one in self.present if pd.notna(first.get(one.floor_column))]
        return ", ".join(f"{first[one.floor_column]:.2g} by {one.label}" for one in known)

    @cached_property
    def numbers(self) -> dict[str, pd.DataFrame]:
        """By budget, the opening one first, a line per sampler, the smallest error first; `key` is
        of its first seed.
        """
        first = opening_budget(self.rows["budget"])
        budgets = [first, *sorted_budgets(list(set(self.rows["budget"]) - {first}))]
        return {
            name: _numbers(self.rows[self.rows["budget"] == name], self.present) for name in budgets
        }

    @property
    def tables(self) -> dict[str, Markup]:
        """The numbers as HTML."""
        headings = {metric.name: metric.label for metric in self.present}
        formats = dict.fromkeys(["sampler", *headings, "rays", "ms", "seeds"], "s")
        return {
            budget: table_html(Table("", rows, formats, headings), f"{slug(budget)}-table")
            for budget, rows in self.numbers.items()
        }

    def viewer(self, looks: Looks) -> dict[str, Any]:
        """What the viewer's script reads; links are relative to the page."""
        shown = self.pictures.get(REFERENCE)
        return {
            "width": self.size[0], "height": self.size[1],
            "steepness": STEEPNESS, "whitest": WHITEST, "colors": error_colors(),
            "errors": [{"name": m.name, "label": m.label} for m in mapped_metrics()],
            "reference": shown and f"../{quoted(shown.preview)}",
            "budgets": [
                {"name": budget, "methods": [self._entry(row, looks) for _, row in rows.iterrows()]}
                for budget, rows in self.numbers.items()
            ],
        }  # fmt: skip

    def _entry(self, row: pd.Series, looks: Looks) -> dict[str, Any]:
        shown, name = self.pictures.get(row["key"]), str(row["sampler"])
        errors = shown.errors if shown else {}
        ranked = [metric for metric in reversed(ranked_metrics()) if metric.name in row]
        return {
            "name": name,
            "label": label_of(name),
            "color": looks[name].color,
            "values": [f"{m.label} {row[m.name].rstrip('*')}" for m in ranked],
            "image": shown and f"../{quoted(shown.preview)}",
            "errors": {metric: f"../{quoted(file)}" for metric, file in errors.items()},
        }


def _numbers(rows: pd.DataFrame, present: Sequence[Metric]) -> pd.DataFrame:
    """Means over seeds of the samplers of a case at a budget, as texts; * marks what is near."""
    ranked = [metric.name for metric in reversed(ranked_metrics()) if metric.name in rows]
    order = rows.groupby("sampler", sort=True)[ranked].mean().sort_values(ranked, kind="stable")
    lines = []
    for label in order.index:
        part = rows[rows["sampler"] == label].sort_values("seed")
        rays = (part["rays_shadow"] + part["rays_brdf"]) / part["rays_primary"]
        line = {"sampler": str(label), "key": str(part["key"].iloc[0])}
        for metric in present:
            near = metric.near_column in part and bool(part[metric.near_column].any())
            line[metric.name] = f"{part[metric.name].mean():.{metric.digits}f}{'*' * near}"
        seconds = (part["seconds_lights"] + part["seconds_render"]).mean()
        line |= {"rays": f"{rays.mean():.1f}", "ms": f"{1e3 * seconds:.0f}"}
        lines.append(line | {"seeds": str(len(part))})
    return pd.DataFrame(lines)


def cases_in_order(rows: pd.DataFrame) -> list[tuple[str, str]]:
    """Scene and map of all cases: the first scene under every map, then the second, and so on."""
    cases = rows[CASE].drop_duplicates().sort_values(CASE[::-1])
    turns = cases.groupby("environment").cumcount().sort_values(kind="stable")
    return [(str(scene), str(name)) for scene, name in cases.loc[turns.index].to_numpy()]


def of_case(run: Run, scene: str, environment: str) -> Run:
    """The run with the rows of a case alone."""
    rows = run.rows
    return replace(run, rows=rows[(rows["scene"] == scene) & (rows["environment"] == environment)])


def case_of(run: Run, pictures: dict[str, Pictures], width: int) -> Case:
    """The case of such a run. pictures : by key; width : of the widest"""
    size = run.size
    if 0 < width < size[0]:
        size = (width, max(1, round(size[1] * width / size[0])))
    return Case(run.rows, size, pictures)


def publish_compared(folder: Path, target: Path, patterns: Sequence[str]) -> list[Path]:
    """Write pictures of a run's cases into a published folder; returns the files.

    patterns : of maps' names, or of scene and map as in "vase_noon-desert"

    Raises EnvlightError where no images are kept, or a pattern matches no case.
    """
    run = Run.load(folder)
    at = run.at(opening_budget(run.rows["budget"]))
    kept = [run.kept_image(row) is not None for _, row in at.iterrows()]
    if not any(kept):
        raise EnvlightError(f"{folder}: no images are kept there; run it without --no-images")
    names = {case: {case[1], f"{case[0]}_{case[1]}"} for case in cases_in_order(at[kept])}
    asked = set(select(sorted(set().union(*names.values())), list(patterns), "case"))
    place = target / FOLDER
    for case in sorted(case for case in names if names[case] & asked):
        one = of_case(replace(run, rows=at[kept]), *case)
        _, wrong = case_pictures(one, place, place, WIDTH, linked=False)
        if wrong:
            raise EnvlightError(wrong[0])
    return sorted(file for file in place.rglob("*") if file.is_file())


def published_cases(run: Run) -> list[Case]:
    """The cases of which a published folder has pictures."""
    place = run.folder / FOLDER
    if not any((place / name).is_dir() for name in (PREVIEWS, ERRORS)):
        return []
    at = replace(run, rows=run.at(opening_budget(run.rows["budget"])))
    parts = [of_case(at, *case) for case in sorted(cases_in_order(at.rows))]
    found = [(one, case_pictures(one, place, place, WIDTH, linked=False)[0]) for one in parts]
    return [case_of(one, pictures, WIDTH) for one, pictures in found if pictures]
