"""Patterns of 300 lights on a map, and how good the images are that they give.

Reproduces Figures 7 and 9 of Wan, Wong and Leung, "Spherical Q²-tree for sampling dynamic
environment sequences", EGSR 2005: where each method puts 300 directional lights, and the PSNR of
images lit by them. All methods of the registry that make one global set of lights take part; those
that draw samples at each shading point, or choose the number of their lights, are left out with
that reason. One set of lights for all pixels, as in the paper: nothing is interleaved. PSNR is of
8-bit sRGB images at the reference's exposure, over all pixels.

The paper compares with LightGen and structured importance sampling, which the registry does not
hold, and with FHIS ("Penrose-based"), which it does. Its PSNR stand on its project page: one scene
under one map, against 100,000 uniform lights; the scenes and maps here are others.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.maps.patterns import select
from experiments.maps.sources import EMBEDDED, EnvironmentSource
from experiments.run.case import Case
from experiments.run.kept_reference import kept_reference
from experiments.run.measure import FLOOR_FACTOR
from experiments.run.rendering import light_count
from experiments.run.request import RunRequest
from experiments.run.runner import run_folder
from experiments.run.sampler_choice import choose_samplers
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import Scale, find_scale
from experiments.run.study import NOTE, Group, Job, Row, Study, run_study, study_environments
from metrics.errors import exposure_scale, psnr, rmse
from renderer import scenes
from renderer.image import write_png
from renderer.render import render
from renderer.view import make_view
from samplers import (
    DirectionalLights,
    EnvironmentMap,
    LayeredLights,
    Lighting,
)
from samplers.environment import LUMINANCE_WEIGHTS

NAME = "static-sampling"
TITLE = "Images lit by fixed patterns of lights (Wan, Wong and Leung 2005, Fig. 9)"
COUNT = 300
SCENES = ["insect", "teapot"]
MAPS = {
    "quick": ["gothic-church", "room-one-window", "fireplace-cabin", "partly-cloudy-hills"],
    "standard": [],
    "paper": [],
}
"""Embedded maps: a church, as the paper's, a window, a fire and a sky; all 32 at larger scales."""
NOISE_TARGET, MOST_SAMPLES = {"quick": 0.005, "standard": 0.003, "paper": 0.002}, 16384
"""Of references: lower than for sixteen lights, as 300 come closer to the truth."""
SEEDS = 3
PUBLISHED = {"q2-tree": 33.9, "structured": 33.9, "fhis": 33.3, "LightGen": 31.9}
"""PSNR in dB on the paper's project page; "structured" and LightGen are not in the registry."""
FORMATS = {
    "method": "s", "lights": ".0f", "psnr": ".2f", "psnr_least": ".2f", "psnr_most": ".2f",
    "rank": ".2f", "rmse": ".4f", "energy_error": ".1e", "published": "s",
}  # fmt: skip


def run(request: RunRequest, dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    scale = replace(
        find_scale(request.scale),
        noise_target=NOISE_TARGET[request.scale],
        max_samples=MOST_SAMPLES,
    )
    patterns = request.maps or (MAPS[scale.name] if request.environments == EMBEDDED else [])
    sources = study_environments(request, patterns, scale.map_height)
    chosen = select(scenes.names(), request.scenes or SCENES, "scene")
    specs = choose_samplers(request.samplers)
    count = request.lights(COUNT)
    folder = run_folder(request.output, NAME, request.scale)
    groups = [
        _group(scene, source, specs, count, scale, folder) for source in sources for scene in chosen
    ]
    modules = (__name__, "renderer.render")
    study = Study(NAME, modules, groups, partial(report, count=count), timed=False)
    return run_study(study, request, dry_run)


def _group(
    scene: str, source: EnvironmentSource, specs: tuple[SamplerSpec, ...], count: int, scale: Scale,
    folder: Path,
) -> Group:  # fmt: skip
    case = Case(scene, source, scale)
    jobs = {
        spec.label: Job(
            {"scene": scene, "environment": source.name, "method": spec.label, "count": count},
            {"case": case.identity, "sampler": spec.identity},
        )
        for spec in specs
        if count >= spec.sampler.minimum_count
    }
    by_label = {spec.label: spec for spec in specs}

    def measure(names: Sequence[str]) -> dict[str, Row]:
        return _measure(case, [by_label[name] for name in names], count, folder)

    return Group(str(case), jobs, measure)


def reason_to_leave_out(lighting: Lighting) -> str:
    """Why a lighting is no fixed pattern of a wanted number of lights; empty where it is one."""
    if isinstance(lighting, DirectionalLights | LayeredLights):
        return ""
    if hasattr(lighting, "half_angle"):
        return "it chooses the number of its area lights"
    return "it draws samples at each shading point"


def _measure(case: Case, specs: list[SamplerSpec], count: int, folder: Path) -> dict[str, Row]:
    environment = case.environment.load()
    rows: dict[str, Row] = {}
    made: dict[str, list[Lighting]] = {}
    for spec in specs:
        seeds = range(SEEDS if spec.sampler.stochastic else 1)
        lightings = [
            spec.sampler.prepare(environment, count, np.random.default_rng(seed)) for seed in seeds
        ]
        reason = reason_to_leave_out(lightings[0])
        if reason:
            rows[spec.label] = {NOTE: f"{spec.label} is left out: {reason}"}
        else:
            made[spec.label] = lightings
    if not made:
        return rows
    view = make_view(
        scenes.make(case.scene), case.scale.width, case.scale.height, case.scale.subpixels
    )
    reference = kept_reference(folder, view, environment, case.scale)
    exposure = exposure_scale(reference.image, view.coverage > 0.0)
    truth = _exposed(reference.image, exposure)
    write_picture(image_tile(folder, case.scene, case.environment.name, "reference"), truth)
    for label, lightings in made.items():
        images = [
            _exposed(render(view, lighting, environment, seed=seed, sets=1).image, exposure)
            for seed, lighting in enumerate(lightings)
        ]
        rows[label] = {
            "lights": float(np.mean([light_count(lighting) for lighting in lightings])),
            "psnr": float(np.mean([psnr(image, truth) for image in images])),
            "rmse": float(np.mean([rmse(image, truth) for image in images])),
            "noise_floor": reference.noise_floor * exposure,
            "energy_error": max(energy_error(environment, lighting) for lighting in lightings),
        }
        write_picture(image_tile(folder, case.scene, case.environment.name, label), images[0])
        _write_pattern(folder, environment, label, lightings[0])
    return rows


def _exposed(image: NDArray[np.float32], exposure: float) -> NDArray[np.float32]:
    return (image * np.float64(exposure)).astype(np.float32)


def energy_error(environment: EnvironmentMap, lighting: Lighting) -> float:
    """|luminous energy of the lights over that of the map − 1|, 0 for a black map."""
    assert isinstance(lighting, DirectionalLights | LayeredLights)
    layers = (
        [lighting] if isinstance(lighting, DirectionalLights)
        else [lighting.direct, lighting.indirect]
    )  # fmt: skip
    energy = sum(float(layer.irradiance.sum(axis=0) @ LUMINANCE_WEIGHTS) for layer in layers)
    total = environment.luminous_flux
    return abs(energy / total - 1.0) if total > 0.0 else 0.0


def image_tile(folder: Path, scene: str, environment: str, label: str) -> Path:
    """Where the picture of an image lies from which sheets are made."""
    return folder / "pictures" / f"{scene}_{environment}_{label}.png"


def pattern_tile(folder: Path, environment: str, label: str) -> Path:
    """Where the picture of a pattern lies from which sheets are made."""
    return folder / "pictures" / f"pattern_{environment}_{label}.png"


def write_picture(path: Path, exposed: NDArray[np.float32]) -> None:
    """A picture of an exposed image, large enough for a label."""
    from experiments.report.light_pattern import enlarged
    from experiments.report.preview import encoded

    write_png(path, enlarged(encoded(exposed)))


def _write_pattern(
    folder: Path, environment: EnvironmentMap, label: str, lighting: Lighting
) -> None:
    from experiments.report.light_pattern import draw_pattern

    write_png(pattern_tile(folder, environment.name, label), draw_pattern(environment, lighting))


def summary_of(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per method: means over scenes and maps, and the mean rank by PSNR."""
    case = ["scene", "environment"]
    ranked = rows.assign(rank=rows.groupby(case)["psnr"].rank(ascending=False, method="average"))
    grouped = ranked.groupby("method", sort=False)
    table = grouped[["lights", "psnr", "rank", "rmse"]].mean()
    table["psnr_least"], table["psnr_most"] = grouped["psnr"].min(), grouped["psnr"].max()
    table["energy_error"] = grouped["energy_error"].max()
    table = table.reset_index().sort_values("rank", kind="stable").reset_index(drop=True)
    texts = {method: f"{value:.1f} dB" for method, value in PUBLISHED.items()}
    return table.assign(published=table["method"].map(texts))


def _floor_sentence(rows: pd.DataFrame) -> str:
    near = int((rows["rmse"] < FLOOR_FACTOR * rows["noise_floor"]).sum())
    return (
        f"References have a noise floor of at most {rows['noise_floor'].max():.4f} (RMSE); "
        f"{near} of {len(rows)} images are closer to theirs than {FLOOR_FACTOR:.0f} times that, "
        "and better than their PSNR says."
    )


def report(rows: pd.DataFrame, folder: Path, count: int) -> list[Path]:
    """Tables by case and by method, PSNR by method, and sheets of patterns and of images."""
    from experiments.report.dot_plot import write_dots
    from experiments.report.frames import present
    from experiments.report.light_pattern import write_sheet
    from experiments.run.record import write_csv

    left_out = sorted(set(rows[NOTE].dropna())) if NOTE in rows else []
    rows = rows[rows[NOTE].isna()].drop(columns=NOTE) if NOTE in rows else rows
    table = summary_of(rows)
    place = {method: k + 1 for k, method in enumerate(table["method"])}
    cases = len(rows.groupby(["scene", "environment"]))
    q2 = f"Here the Q²-tree is number {place['q2-tree']}" if "q2-tree" in place else "Here"
    notes = [
        f"Means over {cases} pairs of scene and map, {count} lights, one set for all pixels; "
        "`rank` is by PSNR within a pair. `energy error` is the largest share of the map's "
        f"luminous energy that the lights miss or add. {q2} of {len(place)} by mean rank; in the "
        "paper it is second in PSNR, on a level with structured importance sampling. The last "
        "column is the paper's (project page; another scene and map). Structured importance "
        "sampling (33.9 dB there) and LightGen (31.9 dB) are not in the registry. `ours` upsamples "
        "half of its image, which costs most where images are small.",
        _floor_sentence(rows),
        *[f"{sentence}." for sentence in left_out],
    ]
    stem = NAME.replace("-", "_")
    files = present(folder, stem, table, FORMATS, TITLE, notes)
    by_case = folder / f"{stem}_cases.csv"
    write_csv(by_case, rows)
    order = rows.set_index("method").loc[list(table["method"])].reset_index()
    files += [
        by_case,
        *write_dots(folder, f"{stem}_psnr", order, "psnr", "method", "PSNR in dB", PUBLISHED),
    ]
    methods = list(table["method"])
    maps = list(rows["environment"].unique())
    if "q2-tree" in methods:
        tiles = {name: pattern_tile(folder, name, "q2-tree") for name in maps}
        files += write_sheet(folder / f"{stem}_q2_tree_patterns.jpg", tiles, 2)
    for environment in maps:
        tiles = {method: pattern_tile(folder, environment, method) for method in methods}
        files += write_sheet(folder / f"{stem}_patterns_{environment}.jpg", tiles, 2)
    for case, part in rows.groupby(["scene", "environment"], sort=False):
        scene, environment = map(str, case)
        found = part.set_index("method")["psnr"]
        labels = {"reference": "reference"} | {
            method: f"{method} {found[method]:.1f} dB" for method in methods if method in found
        }
        tiles = {
            text: image_tile(folder, scene, environment, label) for label, text in labels.items()
        }
        files += write_sheet(folder / f"{stem}_images_{scene}_{environment}.jpg", tiles, 4)
    return files
