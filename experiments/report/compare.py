"""Is a run what a published one says? Row by row, from rows and records alone.

A measurement of one is paired with that of the same keys of the other (`paired_rows`), and put
into the first of these kinds that fits:

same : every value that both have by a metric agrees to the last digit
close : every value within a relative `CLOSE`
within seeds : the means over seeds of sampler and case differ by no more than seeds explain
differs : none of these

Seeds explain a difference where two tests do not tell the runs apart, by any metric: Welch's t-test
of both sets of seeds of the case; and, as few seeds alone tell little, Wilcoxon's signed-rank test
of the logarithms of the ratio of the means over all such cases of the sampler. Either kind is made
at a level of 1 % for all its tests together (Bonferroni), so that rows which draw other random
numbers from the same distribution are taken for different twice in a hundred times at most. A
sampler of one seed has no such range. Images at a budget of seconds depend on the machine's speed:
they are counted and not judged.

Beside that stands what determines a result and is not the same in both: scale, commit, versions of
libraries, kind of machine. Sources: Welch, "The generalization of 'Student's' problem when several
different population variances are involved", Biometrika 34, 1947.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from rich.console import Console

from experiments.report.changes import Change, change_table, changes, headlines
from experiments.report.paired_rows import GRID, PairedRows, paired_rows
from experiments.report.parts import Table
from experiments.report.tables import as_markdown, as_plain
from experiments.run.loaded_run import Run
from experiments.run.record import write_text
from metrics.ranking import signed_rank
from samplers import EnvlightError

Kind = Literal["same", "close", "within seeds", "differs", "timed"]
KINDS: tuple[Kind, ...] = ("same", "close", "within seeds", "differs", "timed")
CLOSE = 1e-3
LEVEL = 0.01
"""How often rows of the same distribution may be called different, over all tests of two runs."""
MOST_NAMED = 5
MACHINE = ("processor", "cores", "threads", "system")
FORMATS: dict[str, str] = {
    "same": "d", "close": "d", "within seeds": "d", "differs": "d", "timed": "d",
    "largest": ".2g", "of": "s",
}  # fmt: skip
HEADINGS = {"close": f"within {CLOSE:g}", "largest": "largest difference"}


@dataclass(frozen=True, eq=False)
class Agreement:
    """What two runs share and how far it agrees.

    rows : of the shared measurements, their keys, their `kind`, and the largest relative difference
        with the label of the metric `of` which it is
    group : the key that they are counted by
    only_first, only_second : measurements that only one of them has
    determinants : what differs, with both values
    """

    rows: pd.DataFrame
    group: str
    only_first: int
    only_second: int
    determinants: dict[str, tuple[str, str]]

    @property
    def reproduced(self) -> bool:
        """Whether no shared measurement differs, and at least one was judged."""
        kinds = self.rows["kind"]
        return not (kinds == "differs").any() and bool((kinds != "timed").any())


def compare(first: Run, second: Run) -> Agreement:
    """How far two runs agree; EnvlightError where they share no measurement."""
    pairs = paired_rows(first, second)
    determinants = differing(first, second)
    if not len(pairs.keys):
        what = "; ".join(f"{name} {a} and {b}" for name, (a, b) in determinants.items())
        names = ", ".join(map(str, pairs.keys))
        raise EnvlightError(
            f"{first.folder} and {second.folder} share no measurement: {names} "
            f"must agree{f' (they differ in {what})' if what else ''}"
        )
    rows = pairs.keys
    difference = relative_difference(pairs.ours, pairs.theirs)
    rows["largest"] = largest = difference.max(axis=1)
    rows["of"] = np.where(largest > 0.0, np.array(pairs.labels)[difference.argmax(axis=1)], "")
    rows["kind"] = np.select([largest == 0.0, largest <= CLOSE], ["same", "close"], "differs")
    if "seed" in rows:
        _explain_by_seeds(rows, pairs)
    rows.loc[pairs.timed, "kind"] = "timed"
    return Agreement(rows, pairs.group, pairs.only_first, pairs.only_second, determinants)


def relative_difference(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """|a − b| over the larger of both; 0 for equal values and where both are no number, else
    infinite where one is no finite number."""
    equal = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.abs(a - b) / np.maximum(np.abs(a), np.abs(b))
    return np.where(equal, 0.0, np.where(np.isfinite(a) & np.isfinite(b), ratio, math.inf))


def _explain_by_seeds(rows: pd.DataFrame, pairs: PairedRows) -> None:
    """Turn "differs" into "within seeds" in the cases that seeds explain."""
    case = [name for name in pairs.keys if name not in ("seed", "largest", "of", "kind")]
    doubtful = rows[(rows["kind"] == "differs") & ~pairs.timed]
    groups = rows.groupby(case).indices
    by_sampler: dict[str, list[NDArray[np.intp]]] = {}
    for key in doubtful[case].drop_duplicates().itertuples(index=False):
        if len(places := groups[tuple(key)]) > 1:
            by_sampler.setdefault(getattr(key, pairs.group), []).append(np.asarray(places))
    a, b = pairs.ours, pairs.theirs
    width = a.shape[1]
    shift_level = LEVEL / max(1, len(by_sampler) * width)
    level = LEVEL / max(1, sum(map(len, by_sampler.values())) * width)
    for cases in by_sampler.values():
        means = [np.array([table[places].mean(axis=0) for places in cases]) for table in (a, b)]
        if any(_shifted(means[0][:, k], means[1][:, k], shift_level) for k in range(width)):
            continue
        for places in cases:
            if all(_alike(a[places, k], b[places, k], level) for k in range(width)):
                kinds = rows.loc[places, "kind"]
                rows.loc[places, "kind"] = kinds.where(kinds != "differs", "within seeds")


def _shifted(a: NDArray[np.float64], b: NDArray[np.float64], level: float) -> bool:
    """Whether values of one side are the larger ones over cases, more than chance explains."""
    with np.errstate(divide="ignore", invalid="ignore"):
        logarithm = np.where(a == b, 0.0, np.log(a / b))
    return signed_rank(logarithm[~np.isnan(logarithm)]) < level


def _alike(a: NDArray[np.float64], b: NDArray[np.float64], level: float) -> bool:
    """Whether two sets of seeds are not told apart; equal sets are not, constant others are."""
    from scipy.stats import ttest_ind

    if np.array_equal(a, b, equal_nan=True):
        return True
    if not (np.isfinite(a).all() and np.isfinite(b).all()) or (np.ptp(a) == 0.0 == np.ptp(b)):
        return False
    return bool(ttest_ind(a, b, equal_var=False).pvalue >= level)


def differing(first: Run, second: Run) -> dict[str, tuple[str, str]]:
    """What determines results and is not the same in two runs' records."""
    both = (_determinants(first), _determinants(second))
    return {
        name: (both[0].get(name, "unknown"), both[1].get(name, "unknown"))
        for name in dict.fromkeys([*both[0], *both[1]])
        if both[0].get(name) != both[1].get(name)
    }


def _determinants(run: Run) -> dict[str, str]:
    record: dict[str, Any] = run.record
    machine, scale = record.get("machine", {}), record.get("scale", {})
    found = {
        "scale": str(scale.get("name", "")),
        "image size": f"{scale.get('width')}×{scale.get('height')}×{scale.get('subpixels')}",
        "commit": str(machine.get("commit") or "unknown"),
        "Python": str(machine.get("python", "")),
        "machine": ", ".join(f"{machine.get(name)}" for name in MACHINE),
    }
    return found | {name: str(number) for name, number in machine.get("versions", {}).items()}


def agreement_table(found: Agreement) -> Table:
    """A line a sampler: how many of its measurements are of which kind, and the worst of them."""
    group = found.group
    counts = pd.crosstab(found.rows[group], found.rows["kind"])
    counts = counts.reindex(columns=list(KINDS), fill_value=0)
    worst = found.rows.loc[found.rows.groupby(group)["largest"].idxmax()].set_index(group)
    counts[["largest", "of"]] = worst[["largest", "of"]]
    formats = {group: "s"} | {
        name: spec for name, spec in FORMATS.items()
        if name not in KINDS or name == "differs" or counts[name].any()
    }  # fmt: skip
    return Table("agreement", counts.reset_index(), formats, HEADINGS)


def sentences(found: Agreement) -> list[str]:
    """The answer, what is missing, what differs, and the worst measurements."""
    rows = found.rows
    counts = {kind: int((rows["kind"] == kind).sum()) for kind in KINDS}
    said = [
        f"{len(rows)} measurements are in both: {counts['same']} agree to the last digit, "
        f"{counts['close']} within a relative {CLOSE:g}, {counts['within seeds']} within what "
        f"seeds explain; {counts['differs']} differ."
    ]
    if counts["timed"]:
        said.append(
            f"{counts['timed']} at a budget of seconds depend on the machine and are not judged."
        )
    if found.only_first or found.only_second:
        said.append(
            f"{found.only_first} measurements are only in the first, {found.only_second} only in "
            "the second."
        )
    for name, (ours, theirs) in found.determinants.items():
        said.append(f"They differ in {name}: {ours} | {theirs}.")
    if not found.determinants:
        said.append("Scale, commit, libraries and machine are the same in both.")
    worst = rows[rows["kind"] == "differs"].sort_values("largest", ascending=False, kind="stable")
    said += [
        f"{_named(row)}: {row['of']} differs by {row['largest']:.2g} of the larger."
        for _, row in worst.head(MOST_NAMED).iterrows()
    ]
    said.append("Reproduced." if found.reproduced else "Not reproduced.")
    return said


def _named(row: pd.Series) -> str:
    """A measurement by its keys; those of a scale are shared by all."""
    keys = row.drop(["largest", "of", "kind", "scale"], errors="ignore")
    words = (f"seed {value}" if name == "seed" else str(value) for name, value in keys.items())
    return " · ".join(word for word in words if word)


def markdown(first: Run, second: Run, found: Agreement, changed: Sequence[Change]) -> str:
    """The comparison as Markdown."""
    lines = [f"# {first.folder} | {second.folder}", as_markdown(agreement_table(found))]
    lines.append("\n".join(f"- {sentence}" for sentence in sentences(found)))
    if changed:
        lines.append("## What changed, case by case")
        lines.append("\n".join(f"- {line}" for line in headlines(changed)))
        lines.append(as_markdown(change_table(changed)))
        lines.append(
            "Ratio: geometric mean over cases of second / first. Smaller, larger: numbers of "
            "cases. p: Wilcoxon's signed-rank test, Holm's correction within a measure."
        )
    return "\n\n".join(lines) + "\n"


def compare_runs(folder: Path, other: Path, output: Path | None = None) -> int:
    """Print how far two run folders agree, and where they do not, what changed; returns the status.

    It is 1 where they do not agree. output : also write it there, as Markdown
    """
    first, second = Run.load(folder), Run.load(other)
    found = compare(first, second)
    of_grids = set(GRID) <= set(first.rows)
    changed = changes(first.rows, second.rows) if of_grids and not found.reproduced else ()
    console = Console()
    if not console.is_terminal:  # a file has no width, and figures must not be cut to a guessed one
        console = Console(width=200)
    texts = [f"{folder} | {other}", as_plain(agreement_table(found)), *sentences(found)]
    if changed:
        texts += ["", as_plain(change_table(changed)), *headlines(changed)]
    for text in texts:
        console.print(text, markup=False, highlight=False)
    if output:
        write_text(output, markdown(first, second, found, changed))
        console.print(str(output), markup=False, highlight=False)
    return 0 if found.reproduced else 1
