"""Is a run what a published one says? Row by row, from rows and records alone.

A measurement of one is paired with that of the same keys of the other (`paired_rows`), and put
into the first of these kinds that fits:

same : every value that both have by a metric agrees to the last digit
close : every value within a relative `CLOSE`
within seeds : the seeds of sampler and case differ by no more than other random numbers explain
differs : none of these

Seeds explain a difference where the runs did not draw the same random numbers, all values are such
as the metric can have, and no test tells the runs apart by any metric: those of the case, with the
noise that the sampler has elsewhere (`seed_noise`); and, as few seeds alone tell little, Wilcoxon's
signed-rank test of the logarithms of the ratio of the means over all such cases of the sampler.
Either kind is made at a level of 1 % for all its tests together (Bonferroni), so that rows which
draw other random numbers from the same distribution are taken for different twice in a hundred
times, or more often where errors have rare outliers. A sampler of one seed has no such range.
Images at a budget of seconds depend on the machine's speed: they are counted and not judged.

A run is reproduced where all rows of both are compared and none differs; where some are not, the
answer is partial. Beside that stands what determines a result and is not the same in both: scale,
commit, versions of libraries, kind of machine.
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
from experiments.report.seed_noise import TESTS, explained
from experiments.report.tables import as_markdown, as_plain, markdown_text
from experiments.run.loaded_run import PACKED_ROWS, RECORD, ROWS, Run, write_text
from experiments.run.outputs import Kind as FileKind
from experiments.run.outputs import check_output
from samplers import EnvlightError

Kind = Literal["same", "close", "within seeds", "differs", "timed"]
KINDS: tuple[Kind, ...] = ("same", "close", "within seeds", "differs", "timed")
CLOSE = 1e-3
LEVEL = 0.01
"""How often rows of the same distribution may be called different, over all tests of two runs."""
PARTIAL = 3
"""The exit status where nothing differs and not all rows of both were compared."""
IN_BOTH = "measurements are in both: "
MARKDOWN = FileKind("a comparison of two runs", (IN_BOTH.encode(),))
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
    of_first, of_second : how many rows either has
    only_first, only_second : measurements that only one of them has
    determinants : what differs, with both values
    """

    rows: pd.DataFrame
    group: str
    of_first: int
    of_second: int
    only_first: int
    only_second: int
    determinants: dict[str, tuple[str, str]]

    @property
    def compared(self) -> int:
        """How many measurements were judged."""
        return int((self.rows["kind"] != "timed").sum())

    @property
    def differs(self) -> bool:
        return bool((self.rows["kind"] == "differs").any())

    @property
    def reproduced(self) -> bool:
        """Whether all rows of both were judged, and none differs."""
        return not self.differs and self.compared == self.of_first == self.of_second

    @property
    def verdict(self) -> str:
        """The last sentence."""
        if self.differs or self.reproduced:
            return "Not reproduced." if self.differs else "Reproduced."
        n = self.compared
        of = f"{n} of {self.of_first} and {n} of {self.of_second} compared"
        if self.of_first == self.of_second:
            of = f"{n} of {self.of_first} compared"
        judged = self.rows["kind"][self.rows["kind"] != "timed"]
        how = "all equal" if (judged == "same").all() else "none differs"
        return f"{of}, {how}: partial." if n else f"{of}: partial."

    @property
    def status(self) -> int:
        """The exit status: 0 where all is reproduced, 1 where something differs, else `PARTIAL`."""
        return 1 if self.differs else 0 if self.reproduced else PARTIAL


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
    if not pairs.labels:
        raise EnvlightError(
            f"{first.folder} and {second.folder} have no value in common to be compared by; run "
            "one of them again with the metrics of the other"
        )
    rows = pairs.keys
    difference = relative_difference(pairs.ours, pairs.theirs)
    rows["largest"] = largest = difference.max(axis=1)
    rows["of"] = np.where(largest > 0.0, np.array(pairs.labels)[difference.argmax(axis=1)], "")
    rows["kind"] = np.select([largest == 0.0, largest <= CLOSE], ["same", "close"], "differs")
    if "seed" in rows:
        _explain_by_seeds(rows, pairs)
    rows.loc[pairs.timed, "kind"] = "timed"
    return Agreement(
        rows, pairs.group, len(first.rows), len(second.rows), pairs.only_first, pairs.only_second,
        determinants,
    )  # fmt: skip


def relative_difference(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """|a − b| over the larger of both; 0 for equal values and where both are no number, else
    infinite where one is no finite number."""
    equal = (a == b) | (np.isnan(a) & np.isnan(b))
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.abs(a - b) / np.maximum(np.abs(a), np.abs(b))
    return np.where(equal, 0.0, np.where(np.isfinite(a) & np.isfinite(b), ratio, math.inf))


def _explain_by_seeds(rows: pd.DataFrame, pairs: PairedRows) -> None:
    """Turn "differs" into "within seeds" in the cases that seeds explain."""
    keys = [name for name in pairs.keys if name not in ("seed", "largest", "of", "kind")]
    cases = [
        np.asarray(places)
        for places in rows[~pairs.timed].groupby(keys, sort=False).groups.values()
        if len(places) > 1
    ]
    differs = (rows["kind"] == "differs").to_numpy()
    # Images without any error agree by themselves.
    same = (rows["kind"] == "same").to_numpy() & (pairs.ours != 0.0).any(axis=1)
    by_group: dict[Any, list[NDArray[np.intp]]] = {}
    for places in cases:
        by_group.setdefault(rows[pairs.group].iloc[places[0]], []).append(places)
    by_group = {
        name: [one for one in found if pairs.possible[one].all()]
        for name, found in by_group.items()
        if 2 * same[np.concatenate(found)].sum() < len(np.concatenate(found))
    }
    doubtful = {
        name: [k for k, one in enumerate(found) if differs[one].any() and not same[one].any()]
        for name, found in by_group.items()
    }
    width = len(pairs.labels)
    tests = TESTS * width * sum(map(len, doubtful.values()))
    shifts = width * sum(map(bool, doubtful.values()))
    levels = LEVEL / np.maximum(1.0, [tests, shifts])
    for name, in_doubt in doubtful.items():
        found = by_group[name]
        for one in explained(*pairs.above_floors, found, in_doubt, levels):
            kinds = rows.loc[found[one], "kind"]
            rows.loc[found[one], "kind"] = kinds.where(kinds != "differs", "within seeds")


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
        f"{len(rows)} {IN_BOTH}{counts['same']} agree to the last digit, "
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
    return [*said, found.verdict]


def _named(row: pd.Series) -> str:
    """A measurement by its keys; those of a scale are shared by all."""
    keys = row.drop(["largest", "of", "kind", "scale"], errors="ignore")
    words = (f"seed {value}" if name == "seed" else str(value) for name, value in keys.items())
    return " · ".join(word for word in words if word)


def markdown(first: Run, second: Run, found: Agreement, changed: Sequence[Change]) -> str:
    """The comparison as Markdown."""
    title = markdown_text(f"# {first.folder} | {second.folder}")
    lines = [title, as_markdown(agreement_table(found))]
    lines.append("\n".join(f"- {markdown_text(sentence)}" for sentence in sentences(found)))
    if changed:
        lines.append("## What changed, case by case")
        lines.append("\n".join(f"- {markdown_text(line)}" for line in headlines(changed)))
        lines.append(as_markdown(change_table(changed)))
        lines.append(
            "Ratio: geometric mean over cases of second / first. Smaller, larger: numbers of "
            "cases. p: Wilcoxon's signed-rank test, Holm's correction within a measure."
        )
    return "\n\n".join(lines) + "\n"


def compare_runs(
    folder: Path, other: Path, output: Path | None = None, better: bool = False
) -> int:
    """Print how far two run folders agree, and where they do not, what changed; returns the status.

    It is 1 where they do not agree, and `PARTIAL` where not all was compared.

    output : also write it there, as Markdown
    better : print what changed alone, which is no matter of agreement: the status is 0
    """
    if output:
        files = [one / name for one in (folder, other) for name in (ROWS, PACKED_ROWS, RECORD)]
        check_output(output, MARKDOWN, reads=files)
    first, second = Run.load(folder), Run.load(other)
    found = compare(first, second)
    of_grids = set(GRID) <= set(first.rows)
    if better and not of_grids:
        raise EnvlightError(f"{folder}: no rows of scenes and maps; leave --better out")
    changed = changes(first.rows, second.rows) if better or (of_grids and found.differs) else ()
    console = Console()
    if not console.is_terminal:  # a file has no width, and figures must not be cut to a guessed one
        console = Console(width=200)
    texts = [f"{folder} | {other}"]
    texts += [] if better else [as_plain(agreement_table(found)), *sentences(found)]
    if changed:
        texts += ["", as_plain(change_table(changed)), *headlines(changed)]
    for text in texts:
        console.print(text, markup=False, highlight=False)
    if output:
        write_text(output, markdown(first, second, found, changed))
        console.print(str(output), markup=False, highlight=False)
    return 0 if better else found.status
