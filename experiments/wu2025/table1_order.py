"""What the order of Table 1 depends on, where the paper leaves something open.

Wu, "Efficient environment map rendering based on decomposition", 2025, prints one row for ours
without upsampling and one for fast hierarchical importance sampling. Two things are not said there:
how many lights the former gets, which takes longer than the full method with the same lights; and
how the points of the latter become lights in eight sets. And time is that of a renderer: the faster
its rays, the more the work weighs that is no ray, such as upsampling.

Here all methods of the table have equal time, and then as many rays each as median cut traced in
it. Under both, ours without upsampling is also rendered with the very lights of ours, however long
that takes; and FHIS also in its plainest form, equal lights at the points of one tiling, which are
perturbed as the lights of other methods are (its default has centroids of cells, in eight shifts
of the tiling, which is better). Each is put in the place of its default and the order compared with
the paper's again.

The default budget is what median cut took for eight lights when it was fixed: 0.9 s at 1600×1200
pixels.
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
from experiments.run.rendering import CaseScene, Shot, light_count, shoot
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
"""Of an image of `PAPER_PIXELS`."""
FULL, WITHOUT, FHIS, MEASURE = "ours", "ours-no-upsampling", "fhis", "median-cut"
SHARED, PLAIN = f"{WITHOUT}, lights of {FULL}", f"{FHIS}[light=point, sets=1]"
METHODS = (*TABLE1.values, PLAIN)
TIME, RAYS = "time", "rays"
WAYS: dict[str, dict[str, str]] = {
    "as they are": {},
    f"{WITHOUT} with the lights of {FULL}": {WITHOUT: SHARED},
    f"{FHIS} in its plainest form": {FHIS: PLAIN},
    "both": {WITHOUT: SHARED, FHIS: PLAIN},
}
"""What stands in whose place."""
METRICS = ("rmse", "flip")


@experiment(NAME)
def table1_order() -> Study:
    """What the order of Table 1 depends on: time or rays, whose lights, which form of FHIS."""
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
    timed = {label: Measurement(case, single_sampler(label), budget, 0) for label in METHODS}
    columns = {"scene": case.scene, "environment": case.environment.name, "budget": str(budget)}
    depends = {
        "reference": case.reference_key,
        "measurements": [one.key for one in timed.values()],
    }
    where = {
        f"{label} ({alike})": (alike, label)
        for alike in (TIME, RAYS)
        for label in (*METHODS, SHARED)
    }
    jobs = {
        name: Job({**columns, "alike": alike, "sampler": label}, depends)
        for name, (alike, label) in where.items()
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        if not reference_path(folder, case).is_file():
            take_reference(case, folder, folder.parent)
        truth = truth_in(folder, case)
        with alone_on_the_machine():
            shots = _shots(timed)
        return {name: _row(*shots[where[name]], truth) for name in names}

    return Group(str(case), jobs, measure)


def _shots(timed: dict[str, Measurement]) -> dict[tuple[str, str], tuple[Shot, Timing]]:
    """Every method's image and its time, at equal time and at the rays of median cut there."""
    case = timed[FULL].case
    scene = CaseScene.of(case)
    shots: dict[tuple[str, str], tuple[Shot, Timing]] = {}
    for one, result in time_at_budget(scene, list(timed.values())).items():
        if isinstance(result, Exception):
            raise result
        shots[TIME, one.sampler.label] = result.shot, result.timing
    rays = Budget(shots[TIME, MEASURE][0].rays, RAYS)
    for label in METHODS:
        _, shot = shoot(Measurement(case, timed[label].sampler, rays, 0))
        shots[RAYS, label] = shot, Timing.of([shot.rendering.seconds])
    for alike in (TIME, RAYS):
        shared = {timed[WITHOUT]: scene.shoot(timed[WITHOUT], shots[alike, FULL][0].count)}
        shots[alike, SHARED] = shared[timed[WITHOUT]], timed_rounds(scene, shared)[timed[WITHOUT]]
    return shots


def _row(shot: Shot, timing: Timing, truth: Truth) -> Row:
    judged = scores(shot.rendering.image, truth, METRICS)
    return {
        "count": shot.count,
        "lights": light_count(shot.lighting),
        "rays": shot.rays,
        **timing.columns("seconds_render"),
        **{key: value for found in judged.values() for key, value in found.items()},
    }


def per_map(run: Run, metric: str, alike: str, way: str) -> pd.DataFrame:
    """Errors (maps × methods of the paper), means over scenes, with what the way puts in place."""
    rows = run.rows[run.rows["alike"] == alike]
    errors = rows.groupby(["environment", "sampler"])[metric].mean().unstack("sampler")
    placed = {label: errors[WAYS[way].get(label, label)] for label in TABLE1.values}
    return pd.DataFrame(placed).dropna()


def agreements(run: Run) -> pd.DataFrame:
    """Spearman's correlation with the paper's order by what is alike, way and metric."""
    return pd.DataFrame(
        [
            {
                "alike": alike, "way": way,
                **{
                    metric: order_agreement(per_map(run, metric, alike, way), TABLE1, metric)
                    for metric in METRICS
                },
            }
            for alike in (TIME, RAYS) for way in WAYS
        ]
    )  # fmt: skip


def orders(run: Run) -> Iterator[Part]:
    """How the orders agree, and the means of every method in every way, beside the paper's."""
    labels = {metric: find_metric(metric).label for metric in METRICS}
    yield Items(tuple(findings(run)))
    yield Table(
        "agreement", agreements(run),
        {"alike": "s", "way": "s", **dict.fromkeys(METRICS, ".2f")},
        {"alike": "equal", **labels},
        caption=f"Spearman's correlation with the order of {TABLE1.paper}.",
    )  # fmt: skip
    for metric, label in labels.items():
        printed = pd.Series({name: values[metric][0] for name, values in TABLE1.values.items()})
        columns = {"paper": printed / printed[MEASURE]}
        for alike in (TIME, RAYS):
            rows = run.rows[run.rows["alike"] == alike]
            means = rows.groupby("sampler")[metric].mean()
            columns[f"equal {alike}"] = means / means[MEASURE]
        table = pd.DataFrame(columns).reindex([*METHODS, SHARED]).rename_axis("sampler")
        yield Heading(f"{label} over that of {MEASURE}")
        yield Table(
            f"order_{metric}", table.reset_index(),
            {"sampler": "s", **dict.fromkeys(columns, ".2f")},
            caption=f"Means over maps and scenes; the paper's are from {TABLE1.paper}.",
        )  # fmt: skip


def findings(run: Run) -> Sequence[str]:
    """How the order agrees with the paper's in every way."""
    found, maps = agreements(run), run.rows["environment"].nunique()
    budget = Budget.parse(str(run.rows["budget"].iloc[0]))
    labels = {metric: find_metric(metric).label for metric in METRICS}
    told = []
    for alike, part in found.groupby("alike", sort=False):
        by_way = "; ".join(
            f"{line['way']} "
            + " and ".join(f"{line[metric]:.2f} by {labels[metric]}" for metric in METRICS)
            for line in part.to_dict("records")
        )
        amount = str(budget) if alike == TIME else f"the rays of {MEASURE} at {budget}"
        told.append(
            f"Spearman's correlation with the order of {TABLE1.paper} over "
            f"{len(TABLE1.values)} methods and {maps} maps at {amount}: {by_way}."
        )
    rows = run.rows[run.rows["alike"] == TIME].set_index(["scene", "environment", "sampler"])
    seconds = rows["seconds_render"].unstack("sampler")
    longer = (seconds[SHARED] / seconds[FULL]).median()
    return (
        *told,
        f"With the lights of {FULL}, {WITHOUT} takes {longer:.2f} times as long (median).",
    )


def costs(run: Run) -> Iterator[Part]:
    """What every method did."""
    columns = ["lights", "rays", "seconds_render", *METRICS]
    table = run.rows.groupby(["alike", "sampler"], sort=False)[columns].mean().reset_index()
    formats = {
        "alike": "s", "sampler": "s", "lights": ".1f", "rays": ".1f", "seconds_render": ".3f",
        **dict.fromkeys(METRICS, ".4f"),
    }  # fmt: skip
    headings = {"alike": "equal", **{metric: find_metric(metric).label for metric in METRICS}}
    yield Heading("What each did")
    yield Table("costs", table, formats, headings, caption=noise_sentence(run.rows))
