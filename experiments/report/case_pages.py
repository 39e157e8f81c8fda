"""What the page of a scene under a map shows: images to compare, and the numbers beside them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.report.links import quoted, slug
from experiments.report.palette import Look
from experiments.report.previews import (
    STEEPNESS,
    WHITEST,
    Pictures,
    decoding_table,
    write_pictures,
)
from experiments.report.rankings import BudgetResult
from experiments.report.run_data import RunData


@dataclass(frozen=True)
class Method:
    """One sampler's line: means over seeds; pictures are of the first seed."""

    label: str
    color: str
    rmse: float
    flip: float
    psnr: float
    rays: float
    seconds: float
    seeds: int
    near_floor: bool
    pictures: Pictures | None


@dataclass(frozen=True)
class CasePage:
    """budgets : by name, the samplers from smallest FLIP on; thumbnail : the reference's preview"""

    scene: str
    environment: str
    file: str
    size: tuple[int, int]
    noise_floor: float
    reference: Pictures | None
    budgets: dict[str, tuple[Method, ...]]

    @property
    def title(self) -> str:
        return f"{self.scene} · {self.environment}"

    @property
    def thumbnail(self) -> str:
        return self.reference.preview if self.reference else ""

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
            "reference": self.reference and f"../{quoted(self.reference.preview)}",
            "budgets": [
                {"name": name, "methods": [_entry(method) for method in methods]}
                for name, methods in self.budgets.items()
            ],
        }

    @property
    def decoding(self) -> str:
        return " ".join(f"{value:g}" for value in decoding_table())


def _entry(method: Method) -> dict[str, Any]:
    pictures = method.pictures
    return {
        "name": method.label,
        "color": method.color,
        "rmse": f"{method.rmse:.4f}",
        "flip": f"{method.flip:.4f}",
        "image": pictures and f"../{quoted(pictures.preview)}",
        "error": f"../{quoted(pictures.flip)}" if pictures and pictures.flip else None,
    }


def contexts(
    data: RunData, found: list[BudgetResult], looks: dict[str, Look], folder: Path, width: int
) -> list[CasePage]:
    """One page per scene and map; without pictures where `width` is 0."""
    pictures = write_pictures(data, folder, width) if width else {}
    budgets = [result.budget for result in found]
    return [
        _page(data, rows, budgets, looks, pictures)
        for _, rows in data.rows.groupby(["scene", "environment"], sort=True)
    ]


def _page(
    data: RunData,
    rows: pd.DataFrame,
    budgets: list[str],
    looks: dict[str, Look],
    pictures: dict[str, Pictures],
) -> CasePage:
    first = rows.iloc[0]
    scene, environment = str(first["scene"]), str(first["environment"])
    reference = data.reference(first["key"])
    width, height, _ = data.view
    return CasePage(
        scene,
        environment,
        f"{slug(f'{scene}_{environment}')}.html",
        (width, height),
        float(first["noise_floor"]),
        pictures.get(f"reference:{reference.stem}") if reference else None,
        {
            budget: _methods(rows[rows["budget"] == budget], looks, pictures)
            for budget in budgets
            if (rows["budget"] == budget).any()
        },
    )


def _methods(
    rows: pd.DataFrame, looks: dict[str, Look], pictures: dict[str, Pictures]
) -> tuple[Method, ...]:
    methods = []
    for label, part in rows.groupby("sampler", sort=True):
        part = part.sort_values("seed")
        rays = (part["rays_shadow"] + part["rays_brdf"]) / part["rays_primary"]
        methods.append(
            Method(
                str(label),
                looks[str(label)].color,
                float(part["rmse"].mean()),
                float(part["flip"].mean()),
                float(part["psnr"].mean()),
                float(rays.mean()),
                float((part["seconds_lights"] + part["seconds_render"]).mean()),
                len(part),
                bool(part["near_noise_floor"].any()),
                pictures.get(part["key"].iloc[0]),
            )
        )
    return tuple(sorted(methods, key=lambda method: (method.flip, method.rmse, method.label)))
