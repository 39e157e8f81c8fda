"""Tables and pictures of the experiment area-lights."""

from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.report.preview import contact_sheet, encoded
from renderer.image import write_jpeg, write_png

TITLE = "Area lights and an ambient map (Arbree, Walter and Bala 2005)"
LIGHTS = {
    "environment": "s", "lights": ".0f", "energy_lights": ".1%", "smallest": ".1f",
    "largest": ".1f", "ms": ".1f", "ms_lower": ".1f", "ms_upper": ".1f",
}  # fmt: skip
IMAGES = {
    "scene": "s", "environment": "s", "method": "s", "lights": ".0f", "rmse": ".4f",
    "flip": ".4f", "brightness": ".3f", "rays_per_point": ".1f", "ms": ".0f",
}  # fmt: skip
MEANS = {
    "scene": "s", "method": "s", "maps": "d", "rmse": ".4f", "flip": ".4f", "brightness": ".3f",
}  # fmt: skip
PUBLISHED = (
    ("Galileo", 8, 12.8, 7.5),
    ("Grace", 10, 6.7, 4.2),
    ("Kitchen", 4, 21.2, 5.6),
    ("St Peter's", 17, 5.1, 4.1),
)
"""Table 1 of the paper: map, lights, frames per second with three boxes and with the column."""
LEAST_WIDTH = 224


def tile_path(folder: Path, names: list[str]) -> Path:
    """Where a picture of a map, or of a scene under a map by a method, lies."""
    return folder / "pictures" / ("_".join(names) + ".png")


def save_tile(folder: Path, names: list[str], image: NDArray) -> None:
    """Write a picture; linear images at the exposure that they have."""
    write_png(tile_path(folder, names), image if image.dtype == np.uint8 else encoded(image))


def report(rows: pd.DataFrame, folder: Path, count: int) -> list[Path]:
    """Lights per map, errors per image and their means, and the pictures."""
    from experiments.report.frames import present

    lights = rows[rows["table"] == "decomposition"].dropna(axis=1, how="all")
    files: list[Path] = []
    if len(lights):
        lights = lights.assign(
            ms=1e3 * lights["seconds"],
            ms_lower=1e3 * lights["seconds_lower"],
            ms_upper=1e3 * lights["seconds_upper"],
        )
        title = f"{TITLE}: Table 1, Fig. 2"
        files += present(folder, "area_lights", lights, LIGHTS, title, _light_notes(lights, count))
        files += _map_sheet(list(lights["environment"]), folder)
    images = rows[rows["table"] == "images"].dropna(axis=1, how="all")
    if len(images):
        files += _write_images(images, folder, count)
    return files


def _light_notes(lights: pd.DataFrame, count: int) -> list[str]:
    found = lights[lights["lights"] > 0]["lights"]
    span = f"{found.min():.0f} to {found.max():.0f}" if len(found) else "none"
    lines = ["| map (the paper's) | lights | fps, 3 boxes | fps, column |", "|:--|--:|--:|--:|"]
    lines += [f"| {name} | {number} | {a} | {b} |" for name, number, a, b in PUBLISHED]
    return [
        f"Lights are found on {len(found)} of {len(lights)} maps: {span} of them. Smallest and "
        f"largest: half angles of the discs in degrees. At most {count} lights, as each gets "
        "at least one ray. Times are medians and quartiles of the whole decomposition; the "
        "paper's took 0.5 to 1.5 hours on two Xeons of 3.06 GHz.",
        "The paper's Table 1, on other maps and a graphics card (GeForce 6800), 512 × 512 pixels; "
        "its reference of 1024 points ran at 0.1 fps:",
        "\n".join(lines),
    ]


def _write_images(images: pd.DataFrame, folder: Path, count: int) -> list[Path]:
    from experiments.report.frames import present, rounded, table

    images = images.assign(ms=1e3 * images["seconds_render"])
    images["rays_per_point"] = images["rays_traced"] / images["points"]
    mean = images.groupby(["scene", "method"], sort=False)[["rmse", "flip", "brightness"]].mean()
    mean["maps"] = images.groupby(["scene", "method"], sort=False)["environment"].nunique()
    means = table(rounded(mean.reset_index(), MEANS), "pipe")
    notes = [
        f"All methods are allowed the same number of rays at each point, {count} or what equal "
        "shares for all discs leave of it; median-cut and ours as so many lights, of which ours "
        "renders most at a quarter of the pixels. Rays per point: those that were traced. "
        "Brightness: mean of the scene over the reference's; above 1, light leaks through the "
        "ambient part, which casts no shadows.",
        "Means over maps:",
        means,
    ]
    title = f"{TITLE}: images, Fig. 3"
    files = present(folder, "area_lights_images", images, IMAGES, title, notes)
    return files + _image_sheet(images, folder)


def _map_sheet(names: list[str], folder: Path) -> list[Path]:
    """Every map with its lights, and beside it the lighting that they stand for."""
    pictures = [
        (f"{name}{label}", _read(tile_path(folder, [name, kind])))
        for name in names
        for kind, label in (("lights", ""), ("lighting", ": lights and ambient"))
        if tile_path(folder, [name, kind]).is_file()
    ]
    return _sheet(pictures, 4, folder / "area_lights_maps.jpg")


def _image_sheet(images: pd.DataFrame, folder: Path) -> list[Path]:
    """One line per scene and map: reference, and each method with its errors."""
    pictures: list[tuple[str, list[str]]] = []
    for key, part in images.groupby(["scene", "environment"], sort=False):
        scene, name = map(str, key)
        pictures.append((f"{name}: reference", [name, scene, "reference"]))
        pictures += [
            (f"{method} {error:.3f} / {flip:.3f}", [name, scene, method])
            for method, error, flip in zip(part["method"], part["rmse"], part["flip"], strict=True)
        ]
    found = [(label, _read(tile_path(folder, names))) for label, names in pictures]
    columns = 1 + images["method"].nunique()
    return _sheet(found, columns, folder / "area_lights_images.jpg")


def _sheet(pictures: list[tuple[str, NDArray[np.uint8]]], columns: int, path: Path) -> list[Path]:
    if not pictures:
        return []
    enlarge = max(1, -(-LEAST_WIDTH // pictures[0][1].shape[1]))
    larger = [(label, p.repeat(enlarge, axis=0).repeat(enlarge, axis=1)) for label, p in pictures]
    write_jpeg(path, contact_sheet(larger, columns))
    return [path]


def _read(path: Path) -> NDArray[np.uint8]:
    from PIL import Image

    with Image.open(path) as picture:
        return np.array(picture.convert("RGB"))
