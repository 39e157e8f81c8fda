"""Rays per second of the shading kernels, beside Embree alone and beside Mitsuba 3.

The fused kernel of global lights and the rendering by multiple importance sampling cull, shade and
trace; beside each, on the very same shadow rays, stand bare loops of Embree's any-hit query, eight
rays wide and in packets like the renderer's, and embreex's own `run`. Where the package `mitsuba`
is installed, its `direct` integrator renders the same meshes, camera and map with the same number
of emitter and BSDF samples at each of the same number of sub-pixels, and is compared by time per
image, primary rays included. All run in interleaved rounds. Rays are counted by the renderer.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import pandas as pd

from experiments.maps.patterns import select
from experiments.maps.sources import EnvironmentSource
from experiments.questions.renderer_throughput.mitsuba_peer import (
    VARIANTS,
    Peer,
    PeerSettings,
    is_installed,
)
from experiments.questions.renderer_throughput.stages import STAGES
from experiments.questions.renderer_throughput.tasks import (
    BARE,
    DISCS,
    EMBREEX,
    IMAGE_GLOBAL,
    IMAGE_MIS,
    IMAGES,
    KEPT_VIEW,
    KERNEL,
    OWN,
    PACKETS,
    SAMPLED,
    STAGED,
    SUBPIXELS,
    TWO_LIGHTS,
    UPSAMPLING,
    VIEW,
    Bench,
    Size,
    emitter_and_bsdf,
)
from experiments.report.parts import Heading, Items, Part, Table, Text
from experiments.report.sentences import counted
from experiments.report.tables import with_milliseconds
from experiments.report.targets import MET, target_verdict
from experiments.run.bench import interleaved, noise_sentence
from experiments.run.case import environment_identity
from experiments.run.experiment import Group, Job, Row, Study, experiment
from experiments.run.identity import source_digest
from experiments.run.loaded_run import Run
from experiments.run.request import RunRequest
from experiments.run.scale import of_scale
from experiments.run.study_run import NOTE, study_environments
from renderer import scenes
from samplers import EnvlightError
from samplers.threads import set_thread_count, thread_count

SCENES = ["glossy"]
MAPS = ["noon-desert"]
MAP_HEIGHT = 512
THREADS = (1, 2)
FORMATS = {
    "scene": "s", "work": "s", "method": "s", "threads": "d", "rays": ",d", "ms": ".1f",
    "ms_lower": ".1f", "ms_upper": ".1f", "million_per_second": ".2f", "ratio": ".2f",
}  # fmt: skip
SIZES = {
    "quick": Size(240, 180, 4, 16, 5),
    "standard": Size(640, 480, 4, 8, 11),
    "paper": Size(800, 600, 16, 4, 5),
}
DISC_SHARE = 0.85 / 2.0
"""Of bare packets' speed: discs may take twice as long a ray as global lights."""
MANY = THREADS[-1]
SCALING_MARGIN = 0.05
"""How much less than Embree's own scaling still counts as the same."""
STAGE_FORMATS = {"scene": "s", "stage": "s", "ns": ".1f", "percent": ".1f"}
TARGET_FORMATS = {
    "scene": "s", "target": "s", "threads": "d", "wanted": ".2f", "reached": ".2f", "verdict": "s",
}  # fmt: skip


@experiment("renderer-throughput")
def renderer_throughput() -> Study:
    """Rays per second beside Embree alone and beside Mitsuba 3."""
    return Study(
        title="Rays per second of the renderer",
        sections=(speeds, targets, stages),
        groups=groups,
        sources=(__name__,),
        findings=findings,
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per scene; EnvlightError for more than one map."""
    size = of_scale(SIZES, request.scale)
    sources = study_environments(request, MAPS, MAP_HEIGHT)
    if len(sources) > 1:
        raise EnvlightError(
            f"renderer-throughput measures under one map, not {len(sources)}; give --maps NAME"
        )
    names = select(scenes.names(), request.scenes or SCENES, "scene")
    return [_group(name, sources[0], size) for name in names]


def _methods() -> list[tuple[str, str]]:
    """Kinds of work and who does them."""
    peers = [f"Mitsuba {variant}" for variant in VARIANTS] if is_installed() else []
    return [
        *((work, method) for work in (KERNEL, SAMPLED) for method in (OWN, BARE, PACKETS, EMBREEX)),
        (VIEW, OWN),
        (DISCS, OWN),
        *((UPSAMPLING, method) for method in (OWN, TWO_LIGHTS)),
        *((image, method) for image in IMAGES for method in (OWN, KEPT_VIEW, *peers)),
        *((STAGED, stage) for stage in STAGES),
    ]


def _group(scene: str, source: EnvironmentSource, size: Size) -> Group:
    depends = {
        "map": environment_identity(source),
        "size": repr(size),
        "scene": source_digest(f"renderer.scenes.{scene.replace('-', '_')}"),
        "samplers": source_digest(
            "samplers.median_cut", "samplers.inversion", "samplers.center_surround"
        ),
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
        for threads in (THREADS if work != STAGED else THREADS[:1])
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        return _measure(scene, source, size, {name: jobs[name].columns for name in names})

    return Group(f"{scene} under {source.name}", jobs, measure)


def _measure(
    name: str, source: EnvironmentSource, size: Size, wanted: dict[str, Row]
) -> dict[str, Row]:
    scene, environment = scenes.make(name), source.load()
    bench = Bench.of(scene, environment, size)
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
                variant, size.width, size.height, size.subpixels, row["threads"],
                *emitter_and_bsdf(row["work"], size),
            )  # fmt: skip
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
            rows[key] = {NOTE: why[key]}
            continue
        rows[key] = timings[key].columns()
        own = not row["method"].startswith("Mitsuba")
        rows[key]["rays"] = bench.rays.get(row["work"]) if own else None
        rows[key]["points"] = bench.points
    return rows


def _on_threads(threads: int, work: Callable[[], Any]) -> None:
    before = thread_count()
    set_thread_count(threads)
    try:
        work()
    finally:
        set_thread_count(before)


def with_rates(rows: pd.DataFrame) -> pd.DataFrame:
    """Rates, and the ratio of speed to bare Embree, or for whole images to the renderer."""
    million = rows["rays"].astype(float) / rows["seconds"] / 1e6
    rates = with_milliseconds(rows).assign(million_per_second=million)
    case = ["scene", "work", "threads"]
    is_base = (rates["method"] == BARE) | (rates["work"].isin(IMAGES) & rates["method"].eq(OWN))
    base = rates.loc[is_base, [*case, "seconds"]].rename(columns={"seconds": "base"})
    merged = rates.merge(base, on=case, how="left")
    merged["rays"] = merged["rays"].astype("Int64")
    return merged.assign(ratio=merged["base"] / merged["seconds"]).drop(columns="base")


def measured(run: Run) -> pd.DataFrame:
    """The rows that have a time."""
    return run.rows[run.rows["seconds"].notna()]


def speeds(run: Run) -> Iterator[Part]:
    """Rates and ratios, and what was left out."""
    rows = measured(run)
    whole = rows[rows["work"] != STAGED].drop(columns="points")
    yield Table("renderer_throughput", with_rates(whole), FORMATS)
    yield Text(
        "`ratio` is speed over that of bare Embree (eight rays a query) on the same rays, or, for "
        "whole images, over that of this renderer. `packets of 16` is Embree alone with packets "
        "and flags like the renderer's. `primary` is all of a view but Embree's hierarchy, which "
        "is kept with the meshes, as Mitsuba keeps its own from load to render: primary rays and "
        "shading points. Images include it but for `renderer, view kept`, which is what a further "
        "image of the same view costs. Mitsuba's rays are not counted. `disc lights` are those of "
        "center-surround with the ambient map; of them only shadow rays are counted. `upsampling` "
        f"is that of half a size, at {SUBPIXELS} sub-pixels, without its guides, which are kept "
        "with the view; beside it, two lights are traced at every point. "
        f"Map {', '.join(rows['environment'].unique())}, {MAP_HEIGHT} rows where embedded."
    )
    notes = (
        [f"Left out: {n}." for n in run.rows[NOTE].dropna().unique()] if NOTE in run.rows else []
    )
    if not rows["method"].str.startswith("Mitsuba").any() and not notes:
        notes = ["Mitsuba was not installed: `pip install 'envlight[peer]'` adds it."]
    yield Items((*notes, noise_sentence(rows)))


def findings(run: Run) -> list[str]:
    """Every target and what is reached of it, on one thread and on more."""
    found = against_targets(measured(run))
    if found.empty:
        return []
    told = []
    for (scene, name), part in found.groupby(["scene", "target"], sort=False):
        reached = " and ".join(
            f"{line['reached']:.2f} on {counted(line['threads'], 'thread')}"
            for line in part.to_dict("records")
        )
        told.append(f"{scene}, {name}: {reached}; wanted {part['wanted'].iloc[0]:.2f}.")
    return told


def targets(run: Run) -> Iterator[Part]:
    """What the speed is meant to reach, and whether it does."""
    found = against_targets(measured(run))
    if len(found):
        yield Heading("Targets")
        yield Table("renderer_throughput_targets", found, TARGET_FORMATS)
        if (found["verdict"] != MET).any():
            yield Text(TRIED)


def stages(run: Run) -> Iterator[Part]:
    """What each stage of shading under MIS costs a point, on one thread."""
    rows = measured(run)
    found = by_stage(rows[rows["work"] == STAGED])
    if len(found):
        yield Heading("MIS with 1 + 1 samples, by stage, on one thread")
        yield Table("renderer_throughput_stages", found, STAGE_FORMATS)
        yield Text(
            "`ns` is what a stage adds, per shading point, to those before it: the median time of "
            "the loop that ends with it, less that of the loop that ends before it. Both samples "
            "count. Embree traces what carries anything."
        )


def by_stage(rows: pd.DataFrame) -> pd.DataFrame:
    """Nanoseconds per shading point and share of the whole for each stage, then of all."""
    parts = []
    for scene, part in rows.groupby("scene", sort=False):
        times = part.set_index("method").reindex(list(STAGES))
        until = 1e9 * times["seconds"] / times["points"]
        ns = until.diff().fillna(until)
        lines = pd.DataFrame({"scene": scene, "stage": times.index, "ns": ns.to_numpy()})
        whole = pd.DataFrame([{"scene": scene, "stage": "all", "ns": until.iloc[-1]}])
        table = pd.concat([lines, whole], ignore_index=True)
        parts.append(table.assign(percent=100.0 * table["ns"] / until.iloc[-1]))
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame()


@dataclass(frozen=True)
class Target:
    """The renderer's speed at a kind of work is to be `wanted` times that of another method."""

    work: str
    method: str
    wanted: float

    @property
    def name(self) -> str:
        """What tables call it."""
        return f"{self.work}: speed over {self.method}"


TRIED = (
    "What misses its target was not made faster by: flags for coherent rays, and other "
    "acceleration structures of Embree; points as a structure of arrays; huge pages; finer guide "
    "tables; a search of the table lane by lane; LLVM's vectorizer of straight-line code switched "
    "off."
)
TARGETS = (
    Target(KERNEL, EMBREEX, 2.0),
    Target(KERNEL, PACKETS, 0.85),
    Target(UPSAMPLING, TWO_LIGHTS, 1.0),
    Target(IMAGE_MIS, "Mitsuba llvm_ad_rgb", 1.5),
    Target(IMAGE_MIS, "Mitsuba scalar_rgb", 4.0),
    Target(IMAGE_GLOBAL, "Mitsuba llvm_ad_rgb", 2.0),
)


def against_targets(rows: pd.DataFrame) -> pd.DataFrame:
    """Each target for which there are times: what is wanted, what is reached, and the verdict."""
    found: list[dict[str, object]] = []
    for scene, part in rows.groupby("scene", sort=False):
        seconds = part.set_index(["work", "method", "threads"])["seconds"].to_dict()
        for target, threads in product(TARGETS, THREADS):
            own = seconds.get((target.work, OWN, threads))
            other = seconds.get((target.work, target.method, threads))
            if own and other:
                name, why = target.name, _why(seconds, target, threads)
                found.append(_judged(scene, name, threads, target.wanted, other / own, why))
        for threads in THREADS:
            discs = _per_ray(part, DISCS, OWN, threads)
            packets = _per_ray(part, KERNEL, PACKETS, threads)
            if discs and packets:
                name = f"{DISCS} with the ambient map: speed a ray over {PACKETS} of {KERNEL}"
                found.append(_judged(scene, name, threads, DISC_SHARE, packets / discs, ""))
        for work in (KERNEL, SAMPLED):
            bare, own = (_scaling(seconds, work, method) for method in (BARE, OWN))
            if bare and own:
                name = f"{work}: {MANY} threads over 1, as bare Embree"
                found.append(_judged(scene, name, MANY, bare - SCALING_MARGIN, own, ""))
    return pd.DataFrame(found)


def _judged(
    scene: object, target: str, threads: int, wanted: float, reached: float, why: str
) -> dict[str, object]:
    verdict = target_verdict(wanted / reached)
    verdict += why if verdict != MET else ""
    return {
        "scene": scene, "target": target, "threads": threads, "wanted": wanted,
        "reached": reached, "verdict": verdict,
    }  # fmt: skip


def _per_ray(rows: pd.DataFrame, work: str, method: str, threads: int) -> float | None:
    """Seconds a ray; None where none is traced."""
    found = rows.query("work == @work and method == @method and threads == @threads")
    if found.empty or not found["rays"].iloc[0] > 0:
        return None
    return float(found["seconds"].iloc[0] / found["rays"].iloc[0])


def _scaling(seconds: dict, work: str, method: str) -> float | None:
    one, more = seconds.get((work, method, 1)), seconds.get((work, method, MANY))
    return one / more if one and more else None


def _why(seconds: dict, target: Target, threads: int) -> str:
    """What Embree alone, at its best, and the view take of the renderer's time, and how fast it
    would be if it did nothing else.
    """
    work = {IMAGE_MIS: SAMPLED, IMAGE_GLOBAL: KERNEL}.get(target.work, target.work)
    own = seconds.get((target.work, OWN, threads))
    alone = [seconds.get((work, method, threads)) for method in (BARE, PACKETS)]
    bare = min(filter(None, alone), default=None)
    if not (own and bare):
        return ""
    parts = [f"Embree alone takes {100 * bare / own:.0f} % of its time on the same shadow rays"]
    view = seconds.get((VIEW, OWN, threads))
    least = bare
    if work != target.work and view:
        parts.append(f"the view {100 * view / own:.0f} %")
        least += view
    other = seconds[(target.work, target.method, threads)]
    return f": {', '.join(parts)}; with no other work the ratio would be {other / least:.2f}"
