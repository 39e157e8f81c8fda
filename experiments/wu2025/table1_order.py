"""What the order of Table 1 depends on, where the paper leaves something open.

Wu, "Efficient environment map rendering based on decomposition", 2025, prints one row for ours
without upsampling and one for fast hierarchical importance sampling. Two things are not said there:
how many lights the former gets, which takes longer than the full method with the same lights; and
how the points of the latter become lights. And time is that of a renderer: the faster its rays, the
more the work weighs that is no ray, such as upsampling.

Here all methods of the table have equal time, and then as many rays each as median cut traced in
it. Under both, ours without upsampling is also rendered with the very lights of ours, however long
that takes; and FHIS also in its plainest form, equal lights at the points of its tiling (its
default has the centroids of their cells, which is better). Each is put in the place of its default
and the order compared with the paper's again.

The default budget is what median cut took for eight lights when it was fixed: 0.9 s at 1600×1200
pixels.
"""

from collections.abc import Iterator, Sequence

import pandas as pd

from experiments.report.parts import Heading, Items, Part, Table
from experiments.report.sections.ranks import order_agreement
from experiments.run.bench import noise_sentence
from experiments.run.budget import Budget
from experiments.run.experiment import Study, experiment
from experiments.run.loaded_run import Run
from experiments.wu2025 import table1_order_rows
from experiments.wu2025.published import TABLE1
from experiments.wu2025.table1_order_rows import (
    FHIS,
    FULL,
    MEASURE,
    METHODS,
    METRICS,
    NAME,
    PLAIN,
    RAYS,
    SHARED,
    TIME,
    WITHOUT,
    groups,
)
from metrics.registry import find_metric

WAYS: dict[str, dict[str, str]] = {
    "as they are": {},
    f"{WITHOUT} with the lights of {FULL}": {WITHOUT: SHARED},
    f"{FHIS} in its plainest form": {FHIS: PLAIN},
    "both": {WITHOUT: SHARED, FHIS: PLAIN},
}
"""What stands in whose place."""


@experiment(NAME)
def table1_order() -> Study:
    """What the order of Table 1 depends on: time or rays, whose lights, which form of FHIS."""
    return Study(
        title="What the order of Table 1 depends on",
        sections=(orders, costs),
        groups=groups,
        sources=(table1_order_rows.__name__,),
        findings=findings,
    )


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
