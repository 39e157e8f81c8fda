"""What of the papers' tables was found again: their orders of methods beside the published runs'.

A paper measured other scenes and maps, so that its figures cannot be met; its order of methods can.
A line compares one, where the methods had what they had alike in the paper, time or lights:
Spearman's correlation of mean errors over the methods that both have, and where the paper's best
one stands here among them.
"""

from collections.abc import Iterator, Sequence

import pandas as pd

from experiments.report.parts import Heading, Items, Part, Table, Text
from experiments.report.sections.ranks import LEAST_FOR_ORDER, order_agreement
from experiments.report.sentences import counted
from experiments.report.summary import compared, errors_per_map, floors_per_map, resolved
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment, Published
from experiments.run.loaded_run import Run
from experiments.run.registry import find_experiment
from metrics.registry import find_metric

AGREES = 0.9
"""Least correlation of an order that counts as the paper's."""
FORMATS = {
    "paper": "s", "run": "s", "images": "s", "maps": "d", "budget": "s", "metric": "s",
    "methods": "d", "spearman": ".2f", "first": "s", "place": "d",
}  # fmt: skip
HEADINGS = {
    "spearman": "Spearman", "first": "first in the paper", "place": "its place here",
}  # fmt: skip


def reproduced(runs: Sequence[Run]) -> Iterator[Part]:
    """The heading, a sentence and the table; nothing where no run stands beside a paper's order."""
    rows = pd.DataFrame([line for run in runs for line in _of_run(run)])
    if rows.empty:
        return
    agree = int((rows["spearman"] >= AGREES).sum())
    first = int((rows["place"] == 1).sum())
    yield Heading("The papers' orders")
    yield Text(
        "Orders of methods that papers print were measured "
        f"{counted(len(rows), 'time')} at a budget of the paper's kind, equal time or equal "
        f"lights: {counted(agree, 'time')} they come out with Spearman's correlation of at least "
        f"{AGREES:g} (least {rows['spearman'].min():.2f}, median "
        f"{rows['spearman'].median():.2f}), and {counted(first, 'time')} the paper's best method "
        "is the best of its methods here. Methods that a paper does not have are left out."
    )
    yield Table("reproduced", rows, FORMATS, HEADINGS)
    yield Items(tuple(_examinations(runs)))


def _examinations(runs: Sequence[Run]) -> Iterator[str]:
    """Where it is told what a paper's order depends on."""
    known = {run.record["experiment"]: run.folder.name for run in runs}
    found = (find_experiment(run.record["experiment"]) for run in runs)
    orders = (one.published for one in found if isinstance(one, GridExperiment) and one.published)
    for source, examined in dict.fromkeys((one.paper, one.examined) for one in orders):
        if examined in known:
            yield f"What the order of {source} depends on is told under `{known[examined]}`."


def _of_run(run: Run) -> Iterator[dict[str, object]]:
    experiment = find_experiment(run.record["experiment"])
    if isinstance(experiment, GridExperiment) and experiment.published is not None:
        published = experiment.published
        for budget in run.budgets:
            if Budget.parse(budget).equal != published.equal:
                continue
            for line in _orders(run.at(budget), published):
                yield {
                    "paper": published.paper,
                    "run": run.folder.name,
                    "images": run.image_size,
                    "budget": budget,
                } | line


def _orders(rows: pd.DataFrame, published: Published) -> Iterator[dict[str, object]]:
    """A line for each metric that the paper prints of enough methods that are here, too."""
    fair = compared(rows)
    for name in dict.fromkeys(name for values in published.values.values() for name in values):
        metric, per_map = find_metric(name), errors_per_map(fair, name)
        if metric.ranked:
            per_map = resolved(per_map, floors_per_map(fair, metric))
        shared = [sampler for sampler in published.values if sampler in per_map]
        if len(shared) < LEAST_FOR_ORDER:
            continue
        less = metric.better == "less"
        first = sorted(shared, key=lambda one: published.values[one][name][0], reverse=not less)[0]
        places = per_map[shared].mean().rank(method="min", ascending=less)
        yield {
            "maps": len(per_map), "metric": metric.label, "methods": len(shared),
            "spearman": order_agreement(per_map, published, name), "first": first,
            "place": int(places.loc[first]),
        }  # fmt: skip
