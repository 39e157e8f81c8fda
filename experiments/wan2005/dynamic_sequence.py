"""How calm lights and images stay while a fire spreads through a still place, frame by frame.

Reproduces section 6 and Figure 10 of Wan 2005. Every method makes 300 lights for each frame, with
the same seed. Between consecutive frames lights (see `metrics.transport`) and images are compared;
the table's caption says what each column is. The paper shows three frames and a video and gives no
number for any of these. Its times, 0.70 s a frame alone and 0.41 s from the frame before, stand
beside those of the Q²-tree built from scratch and mended, which must give the same lights; both are
timed in interleaved rounds on each frame, from the map to its lights and the tree by itself.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd

from experiments.maps import places
from experiments.report.case_figures import keep_tile, kept_tile, sheet, tile_path
from experiments.report.figures import line_plot
from experiments.report.map_picture import draw_pattern
from experiments.report.parts import Heading, Part, Plot, Table, Text
from experiments.report.style import label_of
from experiments.run.bench import noise_sentence
from experiments.run.budget import Budget
from experiments.run.case import Case, choose_scenes, name_and_file
from experiments.run.experiment import (
    Group,
    PaperFigure,
    Row,
    RunRequest,
    Study,
    answer,
    experiment,
)
from experiments.run.loaded_run import Run
from experiments.run.scale import find_scale, of_scale
from experiments.run.study import study_environments
from experiments.wan2005.frame_changes import (
    FireSequence,
    Frames,
    changes,
    lights_alone,
    lights_calmed,
    tree_times,
)
from experiments.wan2005.static_sampling import COUNT, chosen_fixed_sets
from metrics.registry import ranked_metrics
from metrics.truth import Image
from samplers import DirectionalLights, Lighting

NAME = "dynamic-sequence"
SECONDS_ALONE, SECONDS_COHERENT = 0.70, 0.41
"""Section 6: a frame of the sequence by itself, and from the frame before."""
MEASURING = "experiments.wan2005.frame_changes"
SCENES, STILL = ["insect"], ["gallery-skylight"]
"""A bee under a bright window far above the fire, as in the paper."""
WINDOW = {"quick": (86, 93), "standard": (60, 108), "paper": (0, places.FIRE_FRAMES)}
"""Frames rendered, the last exclusive. All hold the paper's 89 to 91."""
NOISE_TARGET, MOST_SAMPLES = {"quick": 0.008, "standard": 0.005, "paper": 0.003}, 16384
ROUNDS = {"quick": 5, "standard": 7, "paper": 7}
TOLERANCE = 0.25
CALMED = f"q2-tree, tolerance {TOLERANCE}"
"""The tree of the frame before, mended until importances are that close to their order."""
OWN, TIMING, REFERENCE = "q2-tree", "timing", "reference"
"""The paper's method; in the column `method`, what a row of times is; a tile of the reference."""
SHOWN = (89, 90, 91)
"""The paper's frames."""
RIVALS = ("structured", "fhis")
"""What Figure 10 shows beside the Q²-tree: structured importance sampling and "Penrose-based"."""
STRIP_METHODS = (REFERENCE, *RIVALS, OWN)
FORMATS = {
    "method": "s", "lights": ".0f", "lights_change": ".3f", "map_change": ".3f",
    "unburnt_change": ".3f", "unburnt_kept": ".3f", "noise_ratio": ".3f",
    "temporal_noise": ".5f", "most_noise": ".5f", "image_change": ".5f", "true_change": ".5f",
}  # fmt: skip
TIMED = ("alone", "coherent", "reading", "tree_alone", "tree_coherent")
TIME_FORMATS = {
    "environment": "s", "scene": "s", "frames": "d", **{f"ms_{name}": ".2f" for name in TIMED},
    "speed_up": ".2f", "speed_up_lower": ".2f", "speed_up_upper": ".2f", "tree_speed_up": ".2f",
    "quads_changed": ".1f", "identical": "d", "published_speed_up": ".2f",
}  # fmt: skip


@experiment(NAME)
def dynamic_sequence() -> Study:
    """Change of lights and images from frame to frame of a fire, and the Q²-tree's times."""
    return Study(
        title="Change between frames of a fire (Wan, Wong and Leung 2005, section 6)",
        sections=(changes_section, times_section),
        groups=groups,
        sources=(MEASURING,),
        figures=(
            PaperFigure("Fig. 10", "three frames of a fire by three methods", calmer_than),
            PaperFigure("§6", "a frame from the one before", saved),
        ),
    )


Measure = Callable[[list[int]], Iterable[Row]]
"""From frames to their rows."""


def groups(request: RunRequest) -> list[Group]:
    """A group per scene, place and method, and one of the Q²-tree's times."""
    scale = find_scale(request.scale)
    noise = request.reference_noise or of_scale(NOISE_TARGET, scale.name)
    scale = replace(scale, noise_target=noise, max_samples=MOST_SAMPLES)
    count, rounds = request.budget(Budget(COUNT)).lights, of_scale(ROUNDS, scale.name)
    specs = {spec.label: spec for spec in chosen_fixed_sets(request.samplers, count)}
    folder = request.folder
    found = []
    for source in study_environments(request, STILL, scale.map_height):
        for name, file in map(name_and_file, choose_scenes(request.scenes or SCENES)):
            sequence = FireSequence(Case(name, source, scale, file), folder)
            for label, spec in specs.items():
                made = partial(lights_alone, sequence, spec, count)
                measure = partial(_changes, sequence, label, made)
                found.append(_group(sequence, label, {"sampler": spec.identity}, count, measure))
            if OWN in specs:
                own = {"sampler": specs[OWN].identity}
                made = partial(lights_calmed, sequence, TOLERANCE, count)
                measure = partial(_changes, sequence, CALMED, made)
                found.append(_group(sequence, CALMED, own, count, measure))
                times = partial(_times, sequence, count, rounds)
                found.append(_group(sequence, TIMING, {**own, "rounds": rounds}, count, times))
    return found


def _group(
    sequence: FireSequence, method: str, depends: Row, count: int, measure: Measure
) -> Group:
    """All frames of a method that have one before them."""
    case = sequence.still
    own = {"scene": case.scene, "environment": case.environment.name, "method": method}
    first, stop = of_scale(WINDOW, case.scale.name)
    asked = (({"frame": frame}, Row(), frame) for frame in range(first + 1, stop))
    label = f"{case}, {'times of the Q²-tree' if method == TIMING else method}"
    identity = {"still": case.reference_identity, **depends}
    return Group(label, asked, measure, own | {"count": count}, identity)


def _changes(
    sequence: FireSequence, label: str, lights: Callable[[Sequence[int]], Frames], frames: list[int]
) -> list[Row]:
    """Of all frames: each needs the one before, and a tree may need all before it."""

    def seen(frame: int, lighting: Lighting, image: Image) -> None:
        if frame in SHOWN:
            _keep_tiles(sequence, label, frame, lighting, image)

    rows = changes(sequence, lights(range(*of_scale(WINDOW, sequence.still.scale.name))), seen)
    return [rows[frame] for frame in frames]


def _times(sequence: FireSequence, count: int, rounds: int, frames: list[int]) -> Iterator[Row]:
    return (tree_times(sequence, frame, count, rounds) for frame in frames)


def _keep_tiles(
    sequence: FireSequence, label: str, frame: int, lighting: Lighting, image: Image
) -> None:
    case, map_now = sequence.still, sequence.map(frame)
    truth = sequence.truth(frame).image
    for method, picture, lights in (
        (REFERENCE, truth, DirectionalLights.none()),
        (label, image, lighting),
    ):
        where = case.scene, case.environment.name, method, frame
        keep_tile(tile_path(sequence.folder, "image", *where), picture)
        keep_tile(tile_path(sequence.folder, "pattern", *where), draw_pattern(map_now, lights))


def changes_section(run: Run) -> Iterator[Part]:
    """Changes by method, over frames, and three frames as pictures."""
    rows = run.rows[run.rows["method"] != TIMING].dropna(axis=1, how="all")
    if rows.empty:
        return
    table = summary_of(rows)
    errors = [metric for metric in ranked_metrics() if metric.name in table]
    formats = FORMATS | {metric.name: f".{metric.digits}f" for metric in errors}
    headings = {metric.name: metric.label for metric in errors}
    pairs = len(rows[["scene", "environment", "frame"]].drop_duplicates())
    caption = (
        f"Means over {pairs} pairs of consecutive frames. `lights change` is light energy × angle "
        "moved, in degrees per unit of energy; energy that goes out or is lit counts as moved by "
        "half a radian. `map change` is that of the maps themselves, on a grid of 64 × 32 cells. "
        "`unburnt` is where no flame ever is: there the true change is 0, and `kept` is the share "
        "of energy in lights that stay exactly as they are. `temporal noise` is the RMSE of the "
        "images' change against the references' change, `noise ratio` that over the true change. "
        "One exposure for all frames; the references' changes have a noise floor of at most "
        f"{rows['change_floor'].max():.5f}."
    )
    yield Heading("Changes between frames")
    yield Table("changes", table, formats, headings, {"noise_ratio": "less"}, caption)
    for case, part in rows.groupby(["scene", "environment"], sort=False):
        where = "_".join(map(str, case))
        yield from _plots(part, list(table["method"]), where)
        yield from _strips(run, where)


def calmer_than(run: Run) -> tuple[str, str]:
    """Than how many of its rivals the Q²-tree is calmer."""
    noise = summary_of(run.rows[run.rows["method"] != TIMING]).set_index("method")["noise_ratio"]
    rivals = [name for name in RIVALS if name in noise]
    calmer = sum(bool(noise[OWN] < noise[name]) for name in rivals)
    told = ", ".join(f"{label_of(name)} {noise[name]:.2f}" for name in (OWN, *rivals))
    return (
        f"{answer(calmer, len(rivals))}: calmer than {calmer} of {len(rivals)}",
        f"Temporal noise of the images over their true change: {told}.",
    )


def saved(run: Run) -> tuple[str, str]:
    """How much faster than from scratch the tree of the frame before is mended."""
    times = time_summary(run.rows[run.rows["method"] == TIMING])
    faster = int((times["speed_up"] > 1.0).sum())
    whole, tree = times["speed_up"].median(), times["tree_speed_up"].median()
    same, frames = times["identical"].sum(), times["frames"].sum()
    return (
        f"{answer(faster, len(times))}: {whole:.2f}× as fast as afresh",
        f"The tree alone {tree:.2f}×, the paper {SECONDS_ALONE / SECONDS_COHERENT:.2f}×; the same "
        f"lights in {same} of {frames} frames.",
    )


def summary_of(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per method: means over pairs of frames, the calmest images first.

    Temporal noise is the root of the mean square, and so is what it is compared with.
    """
    squared = ["temporal_noise", "image_change", "true_change"]
    plain = ["lights", "lights_change", "map_change", "unburnt_change", "unburnt_kept"]
    plain += [metric.name for metric in ranked_metrics() if metric.name in rows]
    grouped = rows.groupby("method", sort=False)
    table = grouped[plain].mean()
    for column in squared:
        table[column] = grouped[column].agg(lambda v: float(np.sqrt(np.mean(np.square(v)))))
    table["most_noise"] = grouped["temporal_noise"].max()
    table["noise_ratio"] = table["temporal_noise"] / table["true_change"]
    return table.reset_index().sort_values("noise_ratio", kind="stable").reset_index(drop=True)


def _plots(part: pd.DataFrame, order: list[str], where: str) -> Iterator[Part]:
    lines = [part[part["method"] == method] for method in order]
    one = part[part["method"] == part["method"].iloc[0]]
    for name, column, truth, axis, of in (
        ("lights", "lights_change", "map_change", "lights moved: degrees per unit of energy",
         "of the map"),
        ("images", "temporal_noise", "true_change", "RMSE of the change from the frame before",
         "for scale"),
    ):  # fmt: skip
        true = one.assign(method=f"true change ({of})", **{column: one[truth]})
        draw = partial(
            line_plot, pd.concat([*lines, true]), "frame", column, "method", ("frame", axis),
            log_x=False,
        )  # fmt: skip
        yield Plot(f"{name}_{where}", draw, f"{where.replace('_', ' · ')}: {axis}.")


def _strips(run: Run, where: str) -> Iterator[Part]:
    """Three consecutive frames, a row of images and a row of patterns for each method."""
    for kind in ("image", "pattern"):
        tiles = [
            (
                f"{label_of(method)}, frame {frame}",
                tile_path(run.folder, kind, where, method, frame),
            )
            for method in STRIP_METHODS
            for frame in SHOWN
        ]
        kept = [(label, kept_tile(path)) for label, path in tiles]
        yield sheet(f"{kind}s_{where}.webp", f"Three frames: {kind}s", kept, len(SHOWN))


def times_section(run: Run) -> Iterator[Part]:
    """Times of the Q²-tree from scratch and from the frame before."""
    rows = run.rows[run.rows["method"] == TIMING].dropna(axis=1, how="all")
    if rows.empty:
        return
    caption = (
        "Medians over frames, interleaved rounds; `speed up` is the median of the frames' ratios "
        "with its quartiles, `identical` how many frames have the same lights, bit for bit, either "
        "way, `quads changed` how many leaves differ from the frame before. `reading` is the pass "
        "over the map, a part of both; `tree` is what comes after it, up to the quads. The last "
        f"column is the paper's: {SECONDS_ALONE:.2f} s alone, {SECONDS_COHERENT:.2f} s coherent, "
        "on its machine and maps."
    )
    yield Heading("Q²-tree: a frame alone and from the frame before")
    yield Table("times", time_summary(rows), TIME_FORMATS, caption=caption)
    yield Text(noise_sentence(rows))


def time_summary(rows: pd.DataFrame) -> pd.DataFrame:
    """One row per scene and place: medians over frames of times and of their ratio."""
    seconds = {f"ms_{name}": 1e3 * rows[f"seconds_{name}"] for name in TIMED}
    rows = rows.assign(
        **seconds,
        speed_up=rows["seconds_alone"] / rows["seconds_coherent"],
        tree_speed_up=rows["seconds_tree_alone"] / rows["seconds_tree_coherent"],
    )
    groups = rows.groupby(["environment", "scene"], sort=False)
    quartiles = groups["speed_up"].quantile(np.array([0.25, 0.75])).unstack()
    table = groups.agg(
        frames=("speed_up", "size"),
        **{name: (name, "median") for name in seconds},
        speed_up=("speed_up", "median"),
    )
    table["speed_up_lower"], table["speed_up_upper"] = quartiles[0.25], quartiles[0.75]
    table["tree_speed_up"] = groups["tree_speed_up"].median()
    table["quads_changed"] = groups["quads_changed"].mean()
    table["identical"] = groups["identical"].sum().astype(int)
    return table.assign(published_speed_up=SECONDS_ALONE / SECONDS_COHERENT).reset_index()
