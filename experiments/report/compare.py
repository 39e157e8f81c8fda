"""Two runs side by side: on the cases that both measured, what became better, worse or slower.

A case is a scene under a map at a budget; a measurement's values are means over the seeds that
both runs have. Per sampler and measure (RMSE, FLIP, seconds to prepare and render) the geometric
mean of the ratio after / before says how much, the counts of cases say how often, and Wilcoxon's
signed-rank test of the logarithms says whether it can be chance. One test is made per sampler and
measure, so p-values are corrected by Holm's method within a measure.

Sources: Wilcoxon, "Individual comparisons by ranking methods", Biometrics Bulletin 1, 1945; Holm,
"A simple sequentially rejective multiple test procedure", Scandinavian Journal of Statistics 6,
1979.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.report.run_data import RunData, load_run
from samplers import EnvlightError

MEASURES = {"rmse": "RMSE", "flip": "FLIP", "seconds": "seconds"}
MEASUREMENT = ["scale", "scene", "environment", "budget", "sampler"]
NARROW = {"smaller": "<", "larger": ">", "equal": "="}
"""Headings on the terminal: on how many cases the value became smaller, larger, or neither."""
LEVEL = 0.05
SAME = 1e-9
"""Relative differences below this are rounding, and count as equal."""


@dataclass(frozen=True)
class Change:
    """One sampler by one measure.

    ratio : geometric mean of after / before; NaN where no case has positive values in both
    better, worse, equal : numbers of cases
    p_value : Wilcoxon's, corrected by Holm's method
    """

    sampler: str
    measure: str
    before: float
    after: float
    ratio: float
    better: int
    worse: int
    equal: int
    p_value: float

    @property
    def verdict(self) -> str:
        """One word: "better", "worse", "equal", or "unclear" where it may be chance."""
        if self.better == self.worse == 0:
            return "equal"
        if self.p_value > LEVEL or math.isnan(self.ratio) or self.ratio == 1.0:
            return "unclear"
        word = ("faster", "slower") if self.measure == "seconds" else ("better", "worse")
        return word[self.ratio > 1.0]


@dataclass(frozen=True, eq=False)
class Comparison:
    """measurements : of both; only_before, only_after : of one of them; notes : sentences"""

    changes: tuple[Change, ...]
    measurements: int
    only_before: int
    only_after: int
    notes: tuple[str, ...]


def compare(before: RunData, after: RunData) -> Comparison:
    """The changes from one run to another; EnvlightError where they share no measurement."""
    keys = [*MEASUREMENT, "seed"]
    first, second = (_values(run.rows).set_index(keys) for run in (before, after))
    shared = first.index.intersection(second.index)
    if not len(shared):
        raise EnvlightError(
            f"{before.folder} and {after.folder} share no measurement: scale, scene, map, budget, "
            "sampler and seed must agree"
        )
    left = first.loc[shared].groupby(level=MEASUREMENT).mean().sort_index()
    right = second.loc[shared].groupby(level=MEASUREMENT).mean().sort_index()
    changes = []
    for measure in MEASURES:
        found = [
            _change(sampler, measure, part[measure].to_numpy(), right.loc[part.index, measure])
            for sampler, part in left.groupby(level="sampler")
        ]
        corrected = holm(np.array([change.p_value for change in found]))
        changes += [
            Change(**{**vars(change), "p_value": float(p)})
            for change, p in zip(found, corrected, strict=True)
        ]
    return Comparison(
        tuple(changes),
        len(shared),
        len(first.index.difference(shared)),
        len(second.index.difference(shared)),
        _notes(before, after),
    )


def _values(rows: pd.DataFrame) -> pd.DataFrame:
    seconds = rows["seconds_lights"] + rows["seconds_render"]
    return rows.assign(seconds=seconds)[[*MEASUREMENT, "seed", *MEASURES]]


def _change(sampler: object, measure: str, before: NDArray, after: pd.Series) -> Change:
    left, right = np.asarray(before, np.float64), after.to_numpy(np.float64)
    same = np.abs(right - left) <= SAME * np.maximum(np.abs(left), np.abs(right))
    positive = (left > 0.0) & (right > 0.0)
    logarithm = np.where(same[positive], 0.0, np.log(right[positive] / left[positive]))
    return Change(
        str(sampler),
        measure,
        float(left.mean()),
        float(right.mean()),
        float(np.exp(logarithm.mean())) if len(logarithm) else math.nan,
        int((~same & (right < left)).sum()),
        int((~same & (right > left)).sum()),
        int(same.sum()),
        signed_rank(logarithm),
    )


def signed_rank(differences: NDArray[np.float64]) -> float:
    """Wilcoxon's two-sided p-value; differences of zero are left out, and 1 where none is left."""
    from scipy.stats import wilcoxon

    changed = differences[differences != 0.0]
    return float(wilcoxon(changed).pvalue) if len(changed) else 1.0


def holm(p_values: NDArray[np.float64]) -> NDArray[np.float64]:
    """p-values corrected for there being several: the k-th smallest of n times n + 1 - k, at most
    1, and never below a smaller one's."""
    order = np.argsort(p_values, kind="stable")
    factors = np.arange(len(p_values), 0, -1)
    corrected = np.empty(len(p_values))
    corrected[order] = np.minimum(np.maximum.accumulate(p_values[order] * factors), 1.0)
    return corrected


def _notes(before: RunData, after: RunData) -> tuple[str, ...]:
    """What makes the two less comparable."""
    notes = []
    references = [
        {str(run.identities[key]["case"]) for key in run.rows["key"]} for run in (before, after)
    ]
    if references[0] != references[1]:
        notes.append(
            "The runs differ in their cases: maps, scenes, references or what measures them. "
            "Errors of shared cases may differ for that reason alone."
        )
    machines = [
        {(s["processor"], s["cores"], s["threads"]) for s in run.sessions}
        for run in (before, after)
    ]
    if machines[0] != machines[1]:
        notes.append("The runs were made on different machines or thread counts: times say little.")
    notes += [
        f"{run.folder} is incomplete: {run.missing} measurements are missing."
        for run in (before, after)
        if run.missing
    ]
    return tuple(notes)


def change_table(comparison: Comparison) -> pd.DataFrame:
    """The changes as text, one line per sampler and measure."""
    return pd.DataFrame(
        [
            {
                "sampler": change.sampler,
                "measure": MEASURES[change.measure],
                "before": f"{change.before:.4f}",
                "after": f"{change.after:.4f}",
                "ratio": "–" if math.isnan(change.ratio) else f"{change.ratio:.3f}",
                "smaller": str(change.better),
                "larger": str(change.worse),
                "equal": str(change.equal),
                "p": f"{change.p_value:.2g}",
                "verdict": change.verdict,
            }
            for change in comparison.changes
        ]
    )


def headlines(comparison: Comparison) -> list[str]:
    """What got worse or slower, then what got better or faster; one sentence where nothing did."""
    sure = [c for c in comparison.changes if c.verdict not in ("equal", "unclear")]
    sure.sort(key=lambda change: -change.ratio)
    lines = [
        f"{change.sampler}: {MEASURES[change.measure]} {change.verdict}, "
        f"{100.0 * (change.ratio - 1.0):+.1f} % (smaller on {change.better}, larger on "
        f"{change.worse} cases, p = {change.p_value:.2g})"
        for change in sure
    ]
    return lines or ["No change that is not likely to be chance."]


def markdown(before: RunData, after: RunData, comparison: Comparison) -> str:
    """The comparison as Markdown."""
    table = change_table(comparison).to_markdown(index=False, disable_numparse=True)
    lines = [
        f"# {before.folder} → {after.folder}",
        "",
        f"{comparison.measurements} measurements are in both runs, {comparison.only_before} "
        "only in the first, "
        f"{comparison.only_after} only in the second.",
        "",
        *(f"- {line}" for line in headlines(comparison)),
        "",
        table,
        "",
        "Ratio: geometric mean over cases of after / before. Smaller, larger: numbers of cases. "
        "p: Wilcoxon's signed-rank test, corrected by Holm's method within a measure.",
        "",
    ]
    for note in comparison.notes:
        lines += [note, ""]
    return "\n".join(lines)


def compare_runs(first: Path, second: Path, output: Path | None) -> None:
    """Print the comparison of two run folders, and write it as Markdown where asked."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    from experiments.run.record import write_text

    before, after = load_run(first), load_run(second)
    comparison = compare(before, after)
    text = change_table(comparison)
    table = Table(title="after / before", box=SIMPLE, padding=(0, 1, 0, 0), show_edge=False)
    for column in text.columns:
        justify = "left" if column in ("sampler", "measure", "verdict") else "right"
        table.add_column(NARROW.get(column, column), justify=justify, no_wrap=True)  # type: ignore[arg-type]
    for line in text.itertuples(index=False):
        table.add_row(*map(str, line))
    console = Console()
    if not console.is_terminal:  # a file has no width, and figures must not be cut to a guessed one
        console = Console(width=200)
    console.print(f"{first} → {second}", markup=False, highlight=False)
    console.print(table)
    for sentence in (*headlines(comparison), *comparison.notes):
        console.print(sentence, markup=False, highlight=False)
    if output:
        report = markdown(before, after, comparison)
        write_text(output, report)
        console.print(str(output), markup=False, highlight=False)
