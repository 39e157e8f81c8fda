"""Is a run what a published one says? Row by row, from rows and records alone.

Rows of a grid are paired by scale, scene, map, budget, sampler and seed and judged by the metrics;
those of a study by the parameters of its rows, which its record names, and by every other number
that does not depend on the machine. A pair is put into the first of these kinds that fits:

same : every value that both have by a metric agrees to the last digit
close : every value within a relative `CLOSE`
within seeds : the seeds of sampler and case differ by no more than other random numbers explain
differs : none of these; or other columns tell two rows apart that seeds do not explain: a count is
    another one, a number is not within `CLOSE`, or a text, such as the hash of what determines the
    reference, is another one, while most rows of the sampler have the same in both runs

Seeds explain a difference where the runs did not draw the same random numbers, as those of equal
keys did, all values are such as the metric can have, and no test tells the runs apart by any
metric: those of the case, with the noise that the sampler has elsewhere (`seed_noise`); and, as few
seeds alone tell little, Wilcoxon's signed-rank test of the logarithms of the ratio of the means of
all such cases of the sampler. Either kind is made at a level of 1 % for all its tests together
(Bonferroni), so that rows which draw other random numbers from the same distribution are taken for
different twice in a hundred times, or more often where errors have rare outliers. A sampler of one
seed has no such range.
Images at a budget of seconds depend on the machine's speed: they are counted and not judged.

A run is reproduced where all rows of both are compared and none differs; where some are not, the
answer is partial. Beside that stands what determines a result and is not the same in both: scale,
commit, versions of libraries, kind of machine.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.report.changes import FORMATS as CHANGE_FORMATS
from experiments.report.changes import HEADINGS as CHANGE_HEADINGS
from experiments.report.changes import changes, headlines
from experiments.report.parts import Heading, Items, Part, Table
from experiments.report.seed_noise import TESTS, explained
from experiments.report.tables import as_plain
from experiments.report.write import as_text
from experiments.run.budget import Budget
from experiments.run.loaded_run import Run
from metrics.registry import NEAR, metrics
from samplers import EnvlightError

Kind = Literal["same", "close", "within seeds", "differs", "timed"]
KINDS: tuple[Kind, ...] = ("same", "close", "within seeds", "differs", "timed")
CLOSE = 1e-3
LEVEL = 0.01
"""How often rows of the same distribution may be called different, over all tests of two runs."""
PARTIAL = 3
"""The exit status where nothing differs and not all rows of both were compared."""
MOST_NAMED = 5
MACHINE = ("processor", "cores", "threads", "system")
FORMATS: dict[str, str] = {
    "same": "d", "close": "d", "within seeds": "d", "differs": "d", "timed": "d",
    "largest": ".2g", "of": "s",
}  # fmt: skip
HEADINGS = {"close": f"within {CLOSE:g}", "largest": "largest difference"}
GRID = ["scale", "scene", "environment", "sampler", "budget", "seed"]
MACHINES_OWN = re.compile(r"seconds|peak_|load_average|rounds$|spread$")
"""How the names of columns begin whose values depend on the machine and its load."""
FOLLOWS = re.compile(r".*_near_floor$|over_budget$")
"""What follows from other columns: judged where those agree to the last digit."""
DECIMALS = re.compile(r"\d+\.\d+")
WHOLE = ("count", "lights")
GROUPS = ("sampler", "method", "pattern")
"""What the rows of a study are counted by: the first of these that it has, or its first key."""


@dataclass(frozen=True, eq=False)
class PairedRows:
    """The measurements that two runs share.

    keys : what they are paired by, as text; one row per measurement
    ours, theirs : (rows, values), the values that both runs have
    labels : of the values
    floors : (rows, values), the larger of both runs' noise floors; 0 where there is none
    possible : (rows,) whether the values of both are finite and such as their metrics can have
    drawn : (rows,) whether both drew the same random numbers, as their keys tell
    unlike : (rows,) by the name of another column, whether it tells both apart
    timed : (rows,) whether a row depends on the machine's speed as a whole
    group : the column of `keys` by which rows are counted
    only_first, only_second : measurements that only one of the runs has
    """

    keys: pd.DataFrame
    ours: NDArray[np.float64]
    theirs: NDArray[np.float64]
    labels: list[str]
    floors: NDArray[np.float64]
    possible: NDArray[np.bool_]
    drawn: NDArray[np.bool_]
    unlike: dict[str, NDArray[np.bool_]]
    timed: NDArray[np.bool_]
    group: str
    only_first: int
    only_second: int

    @property
    def above_floors(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The values of both, those that lie near their floors as that, as rankings take them."""
        least = np.where(self.floors > 0.0, NEAR * self.floors, -np.inf)
        return np.maximum(self.ours, least), np.maximum(self.theirs, least)


def paired_rows(first: Run, second: Run) -> PairedRows:
    """The shared measurements, possibly none; EnvlightError where rows cannot be paired."""
    keys = _keys(first)
    if keys != _keys(second):
        raise EnvlightError(
            f"{first.folder} and {second.folder} are of different experiments: the rows of one are "
            f"told apart by {', '.join(keys)}, those of the other by {', '.join(_keys(second))}"
        )
    left, right = (_by_keys(run, keys) for run in (first, second))
    shared = left.index.intersection(right.index)
    if set(keys) == set(GRID):
        found = [m for m in metrics() if m.name in left and m.name in right]
        names, labels, group = [m.name for m in found], [m.label for m in found], "sampler"
        # An error is no less than 0, and one that pixels have in [0, 1] is there, too.
        low = [0.0 if m.better == "less" else -np.inf for m in found]
        high = [np.inf if m.error_map is None else 1.0 for m in found]
    else:
        names = [str(name) for name in left if name in right and _judged(left[name], right[name])]
        labels, group = list(names), next((name for name in GROUPS if name in keys), keys[0])
        low, high = [-np.inf] * len(names), [np.inf] * len(names)
    ours, theirs = (table.loc[shared, names].to_numpy(np.float64) for table in (left, right))
    inside = [np.isfinite(one) & (one >= low) & (one <= high) for one in (ours, theirs)]
    floors = np.fmax(*(_floors(table.loc[shared], names) for table in (left, right)))
    table = shared.to_frame(index=False)
    timed = np.zeros(len(table), np.bool_)
    if "budget" in keys:
        timed = np.array([bool(b) and Budget.parse(b).timed for b in table["budget"]], np.bool_)
    missing = [len(table.index.difference(shared)) for table in (left, right)]
    others = [rows.loc[shared].drop(columns=names).set_axis(table.index) for rows in (left, right)]
    drawn = np.zeros(len(table), np.bool_)
    if all("key" in rows for rows in others):
        drawn = (others[0]["key"] == others[1]["key"]).to_numpy()
    return PairedRows(
        table, ours, theirs, labels, floors, np.all(inside, axis=(0, 2)), drawn,
        dict(_unlike(others[0], others[1], table, group)), timed, group, missing[0], missing[1],
    )  # fmt: skip


def _unlike(
    left: pd.DataFrame, right: pd.DataFrame, keys: pd.DataFrame, group: str
) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """The columns that both have and that the machine does not change: see `PairedRows.unlike`."""

    def few(odd: pd.Series) -> pd.Series:
        return odd & (odd.groupby(keys[group]).transform("mean") <= 0.5)

    for name in map(str, left):
        if name not in right or name == "machine":
            continue
        if _judged(left[name], right[name]):
            values = (rows[name].to_numpy(np.float64) for rows in (left, right))
            yield name, relative_difference(*values) > (0.0 if name in WHOLE else CLOSE)
        elif not MACHINES_OWN.match(name):
            one, other = (rows[name].astype(object).map(_rounded) for rows in (left, right))
            both, odd = one + "|" + other, few(one != other)
            if name == "reference":  # of a case all rows have one
                usual = both.groupby([keys[one] for one in GRID[:3]])
                odd |= few(both != usual.transform(lambda texts: texts.mode()[0]))
            yield name, odd.to_numpy()


def _rounded(value: object) -> str:
    """As text, whose numbers have so many digits that another processor gives the same."""
    return DECIMALS.sub(lambda found: f"{float(found[0]):.6g}", str(value))


def _floors(rows: pd.DataFrame, names: list[str]) -> NDArray[np.float64]:
    """The noise floors of the values, 0 for those without."""
    columns = [f"{name}_floor" for name in names]
    found = rows.reindex(columns=columns).to_numpy(np.float64)
    return np.where(np.isfinite(found), found, 0.0)


def _keys(run: Run) -> list[str]:
    """The columns that tell a run's rows apart."""
    keys: list[str] = run.record.get("keys", GRID)
    if not set(keys) <= set(run.rows):
        raise EnvlightError(
            f"{run.folder}: its record does not say which columns tell its rows apart, so there is "
            "nothing to compare them by; measure it anew"
        )
    return keys


def _by_keys(run: Run, keys: list[str]) -> pd.DataFrame:
    """Rows under their keys, each as text; a key that a row does not have is empty."""
    words = run.rows[keys].astype(object)
    words = words.where(words.notna(), "").astype(str)
    rows = run.rows.drop(columns=keys).set_axis(pd.MultiIndex.from_frame(words), axis=0)
    return rows[~rows.index.duplicated()].sort_index()


def _judged(first: pd.Series, second: pd.Series) -> bool:
    """Whether a column of a study holds numbers that the machine does not change."""
    numbers = all(pd.api.types.is_numeric_dtype(one.dtype) for one in (first, second))
    return numbers and not MACHINES_OWN.match(str(first.name))


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
    for name, odd in pairs.unlike.items():
        judged = rows["kind"] == "same" if FOLLOWS.match(name) else rows["kind"] != "within seeds"
        odd = odd & judged
        rows.loc[odd & ~pairs.timed, ["largest", "of", "kind"]] = np.inf, name, "differs"
    rows.loc[pairs.timed, "kind"] = "timed"
    return Agreement(
        rows, pairs.group, len(first.rows), len(second.rows), pairs.only_first, pairs.only_second,
        determinants,
    )  # fmt: skip


def relative_difference(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """|a − b| over the larger of both; 0 for equal values and where both are no number, else
    infinite where one is no finite number.
    """
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
        if len(places) > 1 and not pairs.drawn[places].any()
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
        name: spec
        for name, spec in FORMATS.items()
        if name not in KINDS or name == "differs" or counts[name].any()
    }
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
        if math.isfinite(row["largest"])
        else f"{_named(row)}: {row['of']} differs."
        for _, row in worst.head(MOST_NAMED).iterrows()
    ]
    return [*said, found.verdict]


def _named(row: pd.Series) -> str:
    """A measurement by its keys; those of a scale are shared by all."""
    keys = row.drop(["largest", "of", "kind", "scale"], errors="ignore")
    words = (f"seed {value}" if name == "seed" else str(value) for name, value in keys.items())
    return " · ".join(word for word in words if word)


def compare_runs(folder: Path, other: Path, better: bool = False) -> tuple[str, int]:
    """How far two run folders agree, and where they do not, what changed; and the exit status.

    It is 1 where they do not agree, and `PARTIAL` where not all was compared.

    better : what changed alone, which is no matter of agreement: the status is 0
    """
    first, second = Run.load(folder), Run.load(other)
    found = compare(first, second)
    of_grids = set(GRID) <= set(first.rows)
    if better and not of_grids:
        raise EnvlightError(f"{folder}: no rows of scenes and maps; leave --better out")
    parts: list[Part] = [Heading(f"{first.folder} | {second.folder}", 1)]
    if not better:
        parts += [agreement_table(found), Items(tuple(sentences(found)))]
    if better or (of_grids and found.differs):
        changed = changes(first.rows, second.rows)
        parts.append(Heading("What changed, case by case"))
        parts.append(Table("changes", changed, CHANGE_FORMATS, CHANGE_HEADINGS))
        parts.append(Items(tuple(headlines(changed))))
    texts = [as_plain(part) if isinstance(part, Table) else as_text(part) for part in parts]
    return "\n".join(texts), 0 if better else found.status
