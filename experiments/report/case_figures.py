"""Strips of a run's cases: a scene under a map at a budget, as far as its images are kept."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.maps.classes import named_class, without_resolution
from experiments.maps.poly_haven import SUITES
from experiments.report.comparison_figure import StripImage, strip, worst_windows
from metrics.flip import FlipReference
from renderer.image import write_jpeg
from samplers.files.image_file import read_radiance

if TYPE_CHECKING:
    from experiments.run.loaded_run import Run

COLUMNS = 8


@dataclass(frozen=True, eq=False)
class CaseImages:
    """The kept images of a case, exposed, in the run's order of samplers.

    truth : (H, W, 3); rows : of the images, one each
    """

    truth: NDArray[np.float32]
    rows: list[pd.Series]
    images: list[NDArray[np.float32]]

    def flip_maps(self) -> list[NDArray[np.float32]]:
        """HDR-FLIP of every image, (H, W) each, at the exposures that the rows were made with."""
        found = self.rows[0]["flip_exposures"]
        start, stop, count = json.loads(found) if isinstance(found, str) else found
        truth = FlipReference.hdr(self.truth, start, stop, int(count))
        return [truth.compare(image).error_map for image in self.images]


def case_images(run: "Run", scene: str, environment: str, budget: str) -> CaseImages | None:
    """What is kept of a case at a budget; None without its reference or any image."""
    rows = run.rows
    chosen = rows[
        (rows["scene"] == scene) & (rows["environment"] == environment)
        & (rows["budget"] == budget) & (rows["seed"] == 0)
    ]  # fmt: skip
    places = {name: place for place, name in enumerate(run.samplers)}
    chosen = chosen.sort_values("sampler", key=lambda names: names.map(places), kind="stable")
    kept = [(row, run.image(row)) for _, row in chosen.iterrows()]
    there = [(row, path) for row, path in kept if path is not None]
    reference = run.reference(there[0][0]) if there else None
    if reference is None:
        return None
    exposure = float(there[0][0]["exposure"])
    return CaseImages(
        _exposed(reference, exposure),
        [row for row, _ in there],
        [_exposed(path, exposure) for _, path in there],
    )


def _exposed(path: Path, exposure: float) -> NDArray[np.float32]:
    return (read_radiance(path) * np.float64(exposure)).astype(np.float32)


def write_strip(
    path: Path,
    case: CaseImages,
    title: str,
    extra: dict[str, str] | None = None,
    names: dict[str, str] | None = None,
) -> Path:
    """Draw a case's strip.

    extra : a further line of text under the images, by sampler, in place of rays and times
    names : what samplers are called above their images, where not by their labels
    """
    errors = case.flip_maps()
    floor = float(case.rows[0]["noise_floor"])
    pictures = [StripImage("reference", case.truth, None, (f"noise floor {floor:.4f}",))]
    for row, image, error in zip(case.rows, case.images, errors, strict=True):
        numbers = f"RMSE {row['rmse']:.4f}  FLIP {row['flip']:.4f}"
        more = (extra or {}).get(str(row["sampler"]), cost(row))
        label = str(row["sampler"])
        label = (names or {}).get(label, label)
        pictures.append(StripImage(label, image, error, (numbers, more)))
    windows = worst_windows(np.mean(errors, axis=0))
    write_jpeg(path, strip(pictures, windows, title, COLUMNS))
    return path


def cost(row: pd.Series) -> str:
    """What a row's image took: lights, rays per sub-pixel, milliseconds to render."""
    rays = (row["rays_shadow"] + row["rays_brdf"]) / row["rays_primary"]
    return f"{row['lights']} lights, {rays:.1f} rays, {1e3 * row['seconds_render']:.0f} ms"


def hardest_maps(rows: pd.DataFrame, count: int = 2) -> list[str]:
    """The maps whose FLIP, averaged over scenes, is largest even for the best sampler."""
    means = rows.groupby(["environment", "sampler"])["flip"].mean().unstack("sampler")
    least = means.min(axis=1).sort_values(ascending=False, kind="stable")
    return [str(name) for name in least.index[:count]]


def shown_maps(rows: pd.DataFrame, most: int = 8) -> list[str]:
    """The maps that strips are drawn for: all where there are few; else those that Wu 2025 names,
    one of each class of the others in the rows' order, and the two hardest."""
    present = [str(name) for name in rows["environment"].unique()]
    if len(present) <= most:
        return present
    classes: dict[str, str] = {}
    named = []
    for name in present:
        if without_resolution(name) in SUITES["paper-named-12"]:
            named.append(name)
        else:
            classes.setdefault(named_class(name) or "", name)
    return list(dict.fromkeys([*named, *classes.values(), *hardest_maps(rows)]))


def write_strips(
    run: "Run",
    maps: list[str],
    extra: Callable[[CaseImages], dict[str, str]] | None = None,
    names: dict[str, str] | None = None,
) -> dict[str, Path]:
    """Draw the strips of these maps for every scene and budget that have images; by caption.

    Where the images are gone, strips that were drawn before stay as they are.

    extra : text under the images by sampler, in place of what they cost
    names : what samplers are called above their images, where not by their labels
    """
    made: dict[str, Path] = {}
    for environment in maps:
        for scene in sorted(run.rows["scene"].unique()):
            for budget in run.budgets:
                caption = f"{Path(scene).stem} under {environment}, {budget}"
                name = f"{Path(scene).stem}_{environment}_{budget}.jpg"
                path = run.folder / "strips" / name
                case = case_images(run, scene, environment, budget)
                if case is not None:
                    lines = extra(case) if extra else None
                    made[caption] = write_strip(path, case, caption, lines, names)
                elif path.is_file():
                    made[caption] = path
    return made


def gallery(run: "Run", strips: dict[str, Path]) -> list[str]:
    """Lines of Markdown that show the strips."""
    if not strips:
        return ["No images are kept with these rows, so there are no strips.", ""]
    lines = []
    for caption, path in strips.items():
        link = path.relative_to(run.folder).as_posix()
        lines += [f"![{caption}]({link})", ""]
    return lines
