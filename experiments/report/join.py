"""Parts of one grid that were measured apart, on several days or machines, as one run.

A grid of many hours is measured map by map or budget by budget, each part published; what is joined
has the rows of all parts, and a report made from them as from those of one run. Where a change
touched some samplers, these alone are measured again, and renew what an older part has of them.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.report.compare import GRID
from experiments.report.publish import check_no_loss, methods_of, own_files, tabulate
from experiments.run.grid import case_names, gaps, in_fixed_order
from experiments.run.loaded_run import Run, read_record, write_run
from experiments.run.outputs import check_apart, renewed_folder
from samplers import EnvlightError

LARGEST = ("load_average", "load_average_end")
PART = ("rows", "started", "command", "commit")


def join(
    parts: Sequence[Path], target: Path, force: bool = False, renew: bool = False
) -> list[Path]:
    """Write rows, record and report of all parts into `target`; returns the report's files.

    parts : two folders or more of runs or of published runs, of one experiment at one scale, by the
        same samplers, renderer, metrics and libraries; what is timed in a case by one machine
    target : a new folder, or that of an earlier join, which is replaced at once
    force : replace what has rows that no part has, too
    renew : of parts that have a sampler in the same case, the last has all its rows; programs and
        references may differ from part to part

    Raises EnvlightError where the parts were not measured alike, or one measurement is in two.
    """
    runs = [Run.load(part) for part in parts]
    if len(runs) < 2:
        raise EnvlightError("join: one part is given; give two or more")
    before = read_record(target)
    if target.is_dir() and any(target.iterdir()) and "joined" not in before:
        raise EnvlightError(f"{target}: it holds something that was not joined; give a new folder")
    check_apart(target, parts)
    for run in runs:
        if "planned" not in run.record:
            raise EnvlightError(
                f"{run.folder}: the rows of {run.record['experiment']} are no grid's, which alone "
                "can be joined"
            )
    runs = _renewed(runs) if renew else runs
    for one, other in combinations(runs, 2):
        _check(one, other, renew)
    rows = in_fixed_order(pd.concat([run.rows for run in runs], ignore_index=True))
    joined = Run(target, rows, _joined(runs, rows))
    check_no_loss(joined, target, force)
    with renewed_folder(target, own_files(target)) as place:
        write_run(place, rows, joined.record)
        files = [file.relative_to(place) for file in tabulate(place)]
    return [target / file for file in files]


def _renewed(runs: Sequence[Run]) -> list[Run]:
    """Each run without the samplers that a later one has in any of its cases."""
    found: list[Run] = []
    for place, run in enumerate(runs, 1):
        cases, others = set(case_names(run.rows)), (one.rows for one in runs[place:])
        later = {name for one in others for name in one["sampler"][case_names(one).isin(cases)]}
        rows = run.rows[~run.rows["sampler"].isin(later)]
        left, record = set(rows["sampler"]), run.record
        if len(rows) < len(run.rows):
            record = {
                **record,
                "samplers": [name for name in record["samplers"] if name in left],
                "planned": record["planned"] - len(run.rows) + len(rows),
                "missing": {name: one for name, one in record["missing"].items() if name in left},
                "parts": [{**run.parts[-1], "rows": len(rows), "commit": " + ".join(run.commits)}],
            }
        found.append(Run(run.folder, rows, record))
    return found


def _check(one: Run, other: Run, renew: bool) -> None:
    """Refuse parts that were not measured alike, or that hold the same measurement."""
    for what, first, second in _compared(one, other, renew):
        if first != second:
            raise EnvlightError(
                f"{one.folder} and {other.folder} differ in {what} ({first}; {second}); join what "
                "was measured alike"
            )
    twice = one.rows[GRID].merge(other.rows[GRID])
    if len(twice):
        named = " · ".join(map(str, twice.iloc[0].drop("scale")))
        more = f" and {len(twice) - 1} more" if len(twice) > 1 else ""
        raise EnvlightError(
            f"{one.folder} and {other.folder} both hold {named}{more}; leave one of the parts out"
        )


def _compared(one: Run, other: Run, renew: bool) -> Iterator[tuple[str, Any, Any]]:
    """What must be the same in two parts, and what it is."""
    first, second = one.record, other.record
    yield "experiment", first["experiment"], second["experiment"]
    yield "scale", first["scale"], second["scale"]
    if not renew:
        yield "samplers, renderer or metrics", methods_of(one), methods_of(other)
        yield "libraries", first["machine"]["versions"], second["machine"]["versions"]
        yield from _by_case("reference of", "reference", one.rows, other.rows)
    yield from _by_case("machine that timed", "machine", *(r.rows[r.timed] for r in (one, other)))


def _by_case(
    words: str, column: str, one: pd.DataFrame, other: pd.DataFrame
) -> Iterator[tuple[str, str, str]]:
    """What a column says of each case that both have."""
    here, there = (dict(zip(case_names(rows), rows[column], strict=True)) for rows in (one, other))
    for case in sorted(here.keys() & there.keys()):
        yield f"the {words} {case}", here[case], there[case]


def _joined(runs: Sequence[Run], rows: pd.DataFrame) -> dict[str, Any]:
    """The record of a join: that of the first part, with what the others add."""
    records = [run.record for run in runs]
    machines = [record["machine"] for record in records]
    largest = {
        name: max(machine[name] for machine in machines)
        for name in LARGEST
        if all(name in machine for machine in machines)
    }
    return {
        "experiment": records[0]["experiment"],
        "scale": records[0]["scale"],
        "samplers": list(dict.fromkeys(label for run in runs for label in run.samplers)),
        "labels": {k: v for one in records for k, v in one.get("labels", {}).items()},
        "budgets": list(dict.fromkeys(budget for run in runs for budget in run.budgets)),
        "planned": sum(record["planned"] for record in records),
        "missing": _missing(records, rows),
        "machine": {
            **machines[0],
            **largest,
            "methods": " + ".join(dict.fromkeys(map(methods_of, runs))),
        },
        "bad_maps": {k: v for one in records for k, v in one.get("bad_maps", {}).items()},
        "joined": len(runs),
        "parts": [{name: part[name] for name in PART} for run in runs for part in run.parts],
    }


def _missing(records: Sequence[dict[str, Any]], rows: pd.DataFrame) -> dict[str, list[str]]:
    """The cases by sampler that a part planned in vain, or that others have at the same budget."""
    missing: dict[str, dict[str, None]] = {}
    for found in (*(record["missing"] for record in records), gaps(rows)):
        for sampler, cases in found.items():
            missing.setdefault(sampler, {}).update(dict.fromkeys(cases))
    return {sampler: list(cases) for sampler, cases in missing.items()}
