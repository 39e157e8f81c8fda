"""Rays per second of the shading kernels, beside Embree alone and beside Mitsuba 3.

The fused kernel of global lights and the rendering by multiple importance sampling cull, shade and
trace; beside each, on the very same shadow rays, stand a bare loop of Embree's eight-wide any-hit
query and embreex's own `run`. Where the package `mitsuba` is installed, its `direct` integrator
renders the same meshes, camera and map with the same number of samples, and is compared by time
per image, primary rays included. All run in interleaved rounds. Rays are counted by the renderer.
"""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from experiments.bench import interleaved, noise_sentence
from experiments.datasets import EMBEDDED, EnvironmentSource, find_environments, select
from experiments.identity import source_digest
from experiments.mitsuba_peer import VARIANTS, Peer, PeerSettings, is_installed
from experiments.ray_lists import PlainEmbree, global_rays, sampled_rays, trace_bare
from experiments.study import Group, Job, Row, Study, run_study
from renderer import scenes
from renderer.direct import interleaved as interleaved_sets
from renderer.direct import shade_directional
from renderer.monte_carlo import SampleSplit, shade_distribution
from renderer.render import INTERLEAVED_SETS
from renderer.scene import Scene
from renderer.view import View, make_view
from samplers import (
    DirectionalLights,
    EnvironmentMap,
    EnvlightError,
    LightDistribution,
    make_sampler,
)
from samplers.threads import set_thread_count, thread_count

if TYPE_CHECKING:
    from experiments.commands import RunRequest

NAME = "renderer-throughput"
TITLE = "Rays per second of the renderer"
SCENES = ["glossy"]
MAPS = ["noon-desert"]
MAP_HEIGHT = 512
THREADS = (1, 2)
MIS = SampleSplit(1, 1)
KERNEL, SAMPLED, VIEW, IMAGE = "global lights", "MIS", "primary", "image, MIS 1+1"
FORMATS = {
    "scene": "s", "work": "s", "method": "s", "threads": "d", "rays": ",d", "ms": ".1f",
    "ms_lower": ".1f", "ms_upper": ".1f", "million_per_second": ".2f", "ratio": ".2f",
}  # fmt: skip


@dataclass(frozen=True)
class Size:
    width: int
    height: int
    subpixels: int
    lights: int
    rounds: int


SIZES = {
    "quick": Size(240, 180, 4, 16, 5),
    "standard": Size(640, 480, 4, 8, 11),
    "paper": Size(800, 600, 16, 4, 11),
}


def run(request: "RunRequest", dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    size = SIZES.get(request.scale, SIZES["quick"])
    patterns = request.maps or (MAPS if request.environments == EMBEDDED else [])
    found = find_environments(request.environments, patterns, MAP_HEIGHT, request.repair)
    names = select(scenes.names(), request.scenes or SCENES, "scene")
    groups = [_group(name, found[0], size) for name in names]
    return run_study(Study(NAME, (__name__,), groups, report), request, dry_run)


def _methods() -> list[tuple[str, str]]:
    """Kinds of work and who does them."""
    own = [
        (work, method)
        for work in (KERNEL, SAMPLED)
        for method in ("renderer", "bare Embree", "embreex")
    ]
    peers = [f"Mitsuba {variant}" for variant in VARIANTS] if is_installed() else []
    return [*own, (VIEW, "renderer"), (IMAGE, "renderer"), *((IMAGE, peer) for peer in peers)]


def _group(scene: str, source: EnvironmentSource, size: Size) -> Group:
    depends = {
        "map": source.identity,
        "size": repr(size),
        "scene": source_digest(f"renderer.scenes.{scene.replace('-', '_')}"),
        "samplers": source_digest("samplers.median_cut", "samplers.multiple_importance"),
    }
    jobs = {
        f"{work}, {method}, {threads}": Job(
            {
                "scene": scene,
                "environment": source.name,
                "work": work,
                "method": method,
                "threads": threads,
            },
            depends,
        )
        for work, method in _methods()
        for threads in THREADS
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        return _measure(scene, source, size, {name: jobs[name].columns for name in names})

    return Group(f"{scene} under {source.name}", jobs, measure)


def _measure(
    name: str, source: EnvironmentSource, size: Size, wanted: dict[str, Row]
) -> dict[str, Row]:
    scene, environment = scenes.make(name), source.load()
    bench = _Bench.of(scene, environment, size)
    tasks: dict[str, Callable[[], Any]] = {}
    why: dict[str, str] = {}
    with ExitStack() as stack:
        for key, row in wanted.items():
            if not row["method"].startswith("Mitsuba"):
                work = bench.tasks[row["work"], row["method"]]
                tasks[key] = partial(_on_threads, row["threads"], work)
                continue
            variant = row["method"].partition(" ")[2]
            settings = PeerSettings(
                variant, size.width, size.height, size.subpixels, row["threads"]
            )
            try:
                peer = Peer(scene, environment, settings)
            except EnvlightError as error:
                why[key] = str(error)
                continue
            stack.callback(peer.close)
            tasks[key] = partial(peer.render, 1)
        timings = interleaved(tasks, size.rounds)
    rows: dict[str, Row] = {}
    for key, row in wanted.items():
        if key in why:
            rows[key] = {"note": why[key]}
            continue
        rows[key] = timings[key].columns()
        rays = bench.rays[row["work"]] if not row["method"].startswith("Mitsuba") else None
        rows[key]["rays"] = rays
    return rows


def _on_threads(threads: int, work: Callable[[], Any]) -> None:
    before = thread_count()
    set_thread_count(threads)
    try:
        work()
    finally:
        set_thread_count(before)


@dataclass(frozen=True, eq=False)
class _Bench:
    """What is timed, by kind of work and method, and how many rays each kind is."""

    tasks: dict[tuple[str, str], Callable[[], Any]]
    rays: dict[str, int]

    @classmethod
    def of(cls, scene: Scene, environment: EnvironmentMap, size: Size) -> "_Bench":
        rng = np.random.default_rng(0)
        view = make_view(scene, size.width, size.height, size.subpixels)
        lights = make_sampler("median-cut").prepare(environment, size.lights, rng)
        assert isinstance(lights, DirectionalLights)
        sampled = make_sampler("mis").prepare(environment, MIS.light + MIS.brdf, rng)
        assert isinstance(sampled, LightDistribution)
        sets = interleaved_sets(lights, INTERLEAVED_SETS, rng)
        plain = PlainEmbree(scene)
        lists = {
            KERNEL: global_rays(view, sets),
            SAMPLED: sampled_rays(view, sampled, MIS, 0),
        }
        _, kernel_rays = shade_directional(view, sets, lights.irradiance)
        _, sampled_count = shade_distribution(view, environment, sampled, 0, MIS)
        primary = size.width * size.height * size.subpixels
        tasks: dict[tuple[str, str], Callable[[], Any]] = {
            (KERNEL, "renderer"): partial(shade_directional, view, sets, lights.irradiance),
            (SAMPLED, "renderer"): partial(shade_distribution, view, environment, sampled, 0, MIS),
            (VIEW, "renderer"): partial(_view, scene, size),
            (IMAGE, "renderer"): partial(_image, scene, size, environment, sampled),
        }
        for work, rays in lists.items():
            tasks[work, "bare Embree"] = partial(trace_bare, view.embree, rays)
            tasks[work, "embreex"] = partial(plain.trace, rays)
        counts = {
            KERNEL: kernel_rays.traced,
            SAMPLED: sampled_count.traced,
            VIEW: primary,
            IMAGE: primary + sampled_count.traced,
        }
        return cls(tasks, counts)


def _view(scene: Scene, size: Size) -> View:
    return make_view(scene, size.width, size.height, size.subpixels)


def _image(
    scene: Scene, size: Size, environment: EnvironmentMap, lighting: LightDistribution
) -> None:
    """A whole image from the triangles on, as Mitsuba's render call gives."""
    from renderer.render import background_radiance

    view = _view(scene, size)
    points, _ = shade_distribution(view, environment, lighting, 0, MIS)
    view.to_image(points, background_radiance(view, environment))


def with_rates(rows: pd.DataFrame) -> pd.DataFrame:
    """Rates, and the ratio of speed to bare Embree, or for whole images to the renderer."""
    rates = rows.assign(
        ms=1e3 * rows["seconds"],
        ms_lower=1e3 * rows["seconds_lower"],
        ms_upper=1e3 * rows["seconds_upper"],
        million_per_second=rows["rays"].astype(float) / rows["seconds"] / 1e6,
    )
    block = ["scene", "work", "threads"]
    is_base = (rates["method"] == "bare Embree") | (
        rates["work"].eq(IMAGE) & rates["method"].eq("renderer")
    )
    base = rates.loc[is_base, [*block, "seconds"]].rename(columns={"seconds": "base"})
    merged = rates.merge(base, on=block, how="left")
    merged["rays"] = merged["rays"].astype("Int64")
    return merged.assign(ratio=merged["base"] / merged["seconds"]).drop(columns="base")


def report(rows: pd.DataFrame, folder: Path) -> list[Path]:
    """The table of rates and ratios."""
    from experiments.report.frames import present

    measured = rows[rows["seconds"].notna()]
    notes = [
        "`ratio` is speed over that of bare Embree on the same rays, or, for whole images, over "
        "that of this renderer. `primary` is the whole view: Embree's hierarchy, primary rays, "
        "shading points; images include it here, while Mitsuba keeps its hierarchy from load to "
        "render. Mitsuba traces one emitter and one BSDF ray a sample and does not count them. "
        f"Map {', '.join(rows['environment'].unique())}, {MAP_HEIGHT} rows where embedded.",
    ]
    if not is_installed():
        notes.append("Mitsuba is not installed: `pip install 'envlight[peer]'` adds it.")
    if "note" in rows:
        notes += [f"Left out: {note}." for note in rows["note"].dropna().unique()]
    notes.append(noise_sentence(measured))
    return present(folder, NAME.replace("-", "_"), with_rates(measured), FORMATS, TITLE, notes)
