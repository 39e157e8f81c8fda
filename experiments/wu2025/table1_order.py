"""What the order of Table 1 depends on, where the paper leaves something open.

Wu, "Efficient environment map rendering based on decomposition", 2025, prints one row for ours
without upsampling and one for fast hierarchical importance sampling. Two things are not said there:
how many lights the former gets, which takes longer than the full method with the same lights; and
what the eight interleaved sets of the latter are. Here all methods of the table have equal time.
Beside it ours without upsampling is rendered with the very lights of ours, however long that
takes, and FHIS with one shift of its tiling, perturbed as the lights of other methods are, where
its default has eight shifts. Each is then put in the place of its default and the order compared
with the paper's again.

The default budget is what median cut takes for eight lights: 0.9 s at 1600×1200 pixels.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd

from experiments.report.parts import Heading, Items, Part, Table
from experiments.report.sections.ranks import order_agreement
from experiments.run.bench import Timing, noise_sentence
from experiments.run.budget import Budget
from experiments.run.case import Case
from experiments.run.experiment import Group, Job, Row, Study, experiment
from experiments.run.judging import scores, truth_in
from experiments.run.kept_images import reference_path
from experiments.run.loaded_run import Run
from experiments.run.measurement import Measurement
from experiments.run.rendering import CaseScene, Shot, light_count
from experiments.run.request import RunRequest
from experiments.run.runner import run_folder
from experiments.run.sampler_choice import single_sampler
from experiments.run.scale import Scale, find_scale
from experiments.run.scene_choice import choose_scenes, name_and_file
from experiments.run.shared_results import take_reference
from experiments.run.study_run import study_environments
from experiments.run.timed import alone_on_the_machine, time_at_budget, timed_rounds
from experiments.wu2025.published import PAPER_PIXELS, TABLE1
from metrics.registry import find_metric
from metrics.truth import Truth
from samplers import EnvlightError

NAME = "table1-order"
SECONDS = 0.9
"""Of an image of `PAPER_PIXELS`: what median cut takes there for eight lights."""
FULL, WITHOUT, FHIS = "ours", "ours-no-upsampling", "fhis"
SHARED, ONE_SHIFT = f"{WITHOUT}, lights of {FULL}", f"{FHIS}[sets=1]"
WAYS: dict[str, dict[str, str]] = {
    "equal time": {},
    f"{WITHOUT} with the lights of {FULL}": {WITHOUT: SHARED},
    "fhis with one shift": {FHIS: ONE_SHIFT},
    "both": {WITHOUT: SHARED, FHIS: ONE_SHIFT},
}
"""What stands in whose place."""
METRICS = ("rmse", "flip")


@experiment(NAME)
def table1_order() -> Study:
    """What the order of Table 1 depends on: lights of ours without upsampling, sets of FHIS."""
    return Study(
        title="What the order of Table 1 depends on",
        sections=(orders, costs),
        groups=groups,
        sources=(__name__,),
        findings=findings,
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per scene and map."""
    scale = find_scale(request.scale)
    if request.reference_noise:
        scale = scale.with_noise(request.reference_noise)
    sources = study_environments(request, [], scale.map_height)
    budget, folder = _budget(request, scale), run_folder(request.output, NAME, request.scale)
    return [
        _group(Case(name, source, scale, file), budget, folder)
        for name, file in map(name_and_file, choose_scenes(request.scenes or ["vase"]))
        for source in sources
    ]


def _budget(request: RunRequest, scale: Scale) -> Budget:
    if not request.budgets:
        seconds = SECONDS * scale.width * scale.height / PAPER_PIXELS
        return Budget(float(f"{seconds:.4g}"), "seconds")
    budgets = [Budget.parse(text) for text in request.budgets]
    if len(budgets) > 1 or not budgets[0].timed:
        raise EnvlightError(f"--budget {', '.join(map(str, budgets))}: one of seconds=T here")
    return budgets[0]


def _group(case: Case, budget: Budget, folder: Path) -> Group:
    timed = {
        label: Measurement(case, single_sampler(label), budget, 0)
        for label in (*TABLE1.values, ONE_SHIFT)
    }
    columns = {"scene": case.scene, "environment": case.environment.name, "budget": str(budget)}
    depends = {"reference": case.reference_key}
    jobs = {
        label: Job({**columns, "sampler": label}, {**depends, "measurement": one.key})
        for label, one in timed.items()
    }
    keys = {"full": timed[FULL].key, "without": timed[WITHOUT].key}
    jobs[SHARED] = Job({**columns, "sampler": SHARED}, {**depends, **keys})

    def measure(names: Sequence[str]) -> dict[str, Row]:
        if not reference_path(folder, case).is_file():
            take_reference(case, folder, folder.parent)
        scene, truth = CaseScene.of(case), truth_in(folder, case)
        asked = [one for label, one in timed.items() if label in names or label == FULL]
        with alone_on_the_machine():
            found = time_at_budget(scene, asked)
            shots: dict[str, tuple[Shot, Timing]] = {}
            for one, result in found.items():
                if isinstance(result, Exception):
                    raise result
                shots[one.sampler.label] = result.shot, result.timing
            without = timed[WITHOUT]
            shared = {without: scene.shoot(without, shots[FULL][0].count)}
            shots[SHARED] = shared[without], timed_rounds(scene, shared)[without]
        return {name: _row(*shots[name], truth) for name in names}

    return Group(str(case), jobs, measure)


def _row(shot: Shot, timing: Timing, truth: Truth) -> Row:
    judged = scores(shot.rendering.image, truth, METRICS)
    return {
        "count": shot.count,
        "lights": light_count(shot.lighting),
        "rays": shot.rays,
        **timing.columns("seconds_render"),
        **{key: value for found in judged.values() for key, value in found.items()},
    }


def per_map(run: Run, metric: str, way: str) -> pd.DataFrame:
    """Errors (maps × methods of the paper), means over scenes, with what the way puts in place."""
    errors = run.rows.groupby(["environment", "sampler"])[metric].mean().unstack("sampler")
    return pd.DataFrame(
        {label: errors[WAYS[way].get(label, label)] for label in TABLE1.values}
    ).dropna()


def agreements(run: Run) -> pd.DataFrame:
    """Spearman's correlation with the paper's order, a line per way, a column per metric."""
    return pd.DataFrame(
        {
            metric: {
                way: order_agreement(per_map(run, metric, way), TABLE1, metric) for way in WAYS
            }
            for metric in METRICS
        }
    )


def orders(run: Run) -> Iterator[Part]:
    """Means and mean ranks of every method in every way, beside the paper's."""
    for metric in METRICS:
        label, columns, formats = find_metric(metric).label, {}, {"sampler": "s"}
        printed = pd.Series({name: TABLE1.values[name][metric][0] for name in TABLE1.values})
        columns["paper"] = printed / printed["median-cut"]
        for way in WAYS:
            means = per_map(run, metric, way).mean()
            columns[way] = means / means["median-cut"]
        formats |= dict.fromkeys(columns, ".2f")
        table = pd.DataFrame(columns).rename_axis("sampler").reset_index()
        yield Heading(f"{label} over that of median-cut")
        yield Table(
            f"order_{metric}", table, formats,
            caption=f"Mean {label} over maps, over that of median-cut; the paper's from "
            f"{TABLE1.source.removesuffix(' (ranks in brackets)')}.",
        )  # fmt: skip
    yield Items(tuple(findings(run)))


def findings(run: Run) -> Sequence[str]:
    """How the order agrees with the paper's in every way."""
    found, maps = agreements(run), run.rows["environment"].nunique()
    budget = Budget.parse(str(run.rows["budget"].iloc[0]))
    labels = {metric: find_metric(metric).label for metric in METRICS}
    told = [
        f"{way}: "
        + ", ".join(f"{float(found[metric][way]):.2f} by {labels[metric]}" for metric in METRICS)
        for way in WAYS
    ]
    rows = run.rows.set_index(["scene", "environment", "sampler"])["seconds_render"]
    wide = rows.unstack("sampler")
    longer = (wide[SHARED] / wide[FULL]).median()
    return (
        f"Spearman's correlation of the paper's order and ours over {len(TABLE1.values)} methods "
        f"and {maps} maps at {budget}: {'; '.join(told)}.",
        f"With the lights of {FULL}, {WITHOUT} takes {longer:.2f} times as long (median).",
    )


def costs(run: Run) -> Iterator[Part]:
    """What every method did in the time."""
    table = (
        run.rows.groupby("sampler", sort=False)[["lights", "rays", "seconds_render", *METRICS]]
        .mean()
        .reset_index()
    )
    formats = {
        "sampler": "s", "lights": ".1f", "rays": ".1f", "seconds_render": ".3f",
        **dict.fromkeys(METRICS, ".4f"),
    }  # fmt: skip
    headings = {metric: find_metric(metric).label for metric in METRICS}
    yield Heading("What each did in the time")
    yield Table("costs", table, formats, headings, caption=noise_sentence(run.rows))
