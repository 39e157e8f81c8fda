"""What the page of a scene under a map shows: images to compare, and the numbers beside them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.report.previews import (
    STEEPNESS,
    WHITEST,
    Pictures,
    decoding_table,
    error_colors,
    mapped_metrics,
    write_pictures,
)
from experiments.report.run_data import RunData, quoted, slug
from experiments.report.style import Look
from metrics.registry import Metric, metrics, ranked_metrics


@dataclass(frozen=True)
class Value:
    """A mean over seeds as text; near : whether any of them lies near its floor"""

    text: str
    near: bool


@dataclass(frozen=True)
class Method:
    """One sampler's line: means over seeds; pictures are of the first seed. values : by metric"""

    label: str
    color: str
    values: dict[str, Value]
    rays: float
    seconds: float
    seeds: int
    pictures: Pictures | None


@dataclass(frozen=True)
class CasePage:
    """size : columns and rows of the pictures; metrics : those that the rows hold

    floors : what the reference's own noise gives, as text by the metric's label
    budgets : by name, the samplers from the smallest error by the leading metric on
    """

    scene: str
    environment: str
    file: str
    size: tuple[int, int]
    metrics: tuple[Metric, ...]
    floors: dict[str, str]
    reference: Pictures | None
    budgets: dict[str, tuple[Method, ...]]

    @property
    def title(self) -> str:
        return f"{self.scene} · {self.environment}"

    @property
    def thumbnail(self) -> str:
        return self.reference.thumbnail if self.reference else ""

    @property
    def viewable(self) -> bool:
        """Whether there are pictures to compare."""
        return any(m.pictures for methods in self.budgets.values() for m in methods)

    @property
    def viewer(self) -> dict[str, Any]:
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
                {"name": name, "methods": [self._entry(method) for method in methods]}
                for name, methods in self.budgets.items()
            ],
        }

    def _entry(self, method: Method) -> dict[str, Any]:
        pictures = method.pictures
        ranked = reversed([metric for metric in self.metrics if metric.ranked])
        return {
            "name": method.label,
            "color": method.color,
            "values": [f"{m.label} {method.values[m.name].text}" for m in ranked],
            "image": pictures and f"../{quoted(pictures.preview)}",
            "errors": {
                name: f"../{quoted(file)}"
                for name, file in (pictures.errors if pictures else {}).items()
            },
        }

    @property
    def decoding(self) -> str:
        return " ".join(f"{value:g}" for value in decoding_table())


def contexts(data: RunData, looks: dict[str, Look], folder: Path, width: int) -> list[CasePage]:
    """One page per scene and map; without pictures where `width` is 0."""
    pictures = write_pictures(data, folder, width) if width else {}
    return [
        _page(data, rows, looks, pictures, width)
        for _, rows in data.rows.groupby(["scene", "environment"], sort=True)
    ]


def _page(
    data: RunData,
    rows: pd.DataFrame,
    looks: dict[str, Look],
    pictures: dict[str, Pictures],
    most: int,
) -> CasePage:
    first = rows.iloc[0]
    scene, environment = str(first["scene"]), str(first["environment"])
    reference = data.reference(first["key"])
    width, height, _ = data.view
    if 0 < most < width:
        width, height = most, max(1, round(height * most / width))
    present = _present(rows)
    return CasePage(
        scene,
        environment,
        f"{slug(f'{scene}_{environment}')}.html",
        (width, height),
        present,
        {
            metric.label: f"{first[metric.floor_column]:.2g}"
            for metric in present
            if metric.floor_column in rows and pd.notna(first[metric.floor_column])
        },
        pictures.get(f"reference:{reference.stem}") if reference else None,
        {
            budget: _methods(rows[rows["budget"] == budget], looks, pictures)
            for budget in data.budgets
            if (rows["budget"] == budget).any()
        },
    )


def _methods(
    rows: pd.DataFrame, looks: dict[str, Look], pictures: dict[str, Pictures]
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
            for metric in _present(rows)
        }
        seconds = part["seconds_lights"] + part["seconds_render"]
        shown = pictures.get(part["key"].iloc[0])
        found.append(
            Method(
                label, looks[label].color, values, float(rays.mean()), float(seconds.mean()),
                len(part), shown,
            )
        )  # fmt: skip
    return tuple(found)


def _present(rows: pd.DataFrame) -> tuple[Metric, ...]:
    return tuple(metric for metric in metrics() if metric.name in rows)
