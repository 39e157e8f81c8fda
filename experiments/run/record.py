"""What of a run is enough to make its tables and plots again: its rows and its record.

`measurements.csv` holds the finished rows with all digits, or `measurements.csv.gz` where they
are published; `run.json` says which experiment they belong to, what was planned, on which
machine, by which versions and command, and the types of the columns, so that what is read is what
was written.

In every CSV file a text that a spreadsheet would take for a formula begins with an apostrophe more
than it has; numbers stand as they are.
"""

import gzip
import json
import re
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.run.store import is_run_folder
from renderer.image import write_whole
from samplers import EnvlightError

ROWS, PACKED_ROWS, RECORD = "measurements.csv", "measurements.csv.gz", "run.json"
REPORT = "report.md"
REPORT_FILES = "report_files"
"""What a record calls the list of the files that the report's writer made."""
UNREADABLE = (
    ValueError, KeyError, TypeError, EOFError, gzip.BadGzipFile, zlib.error, pd.errors.ParserError,
)  # fmt: skip


FORMULA = re.compile(r"'*[=+\-@\t\r]")
"""How a text begins that a spreadsheet may run, behind apostrophes that say that it is none."""


def _is_formula(value: Any) -> bool:
    """Whether a cell is a text that a spreadsheet may run; numbers that are written as text, such
    as -0.5, are none."""
    if not isinstance(value, str) or not FORMULA.match(value):
        return False
    try:
        float(value)
    except ValueError:
        return True
    return False


def _as_text(value: Any) -> Any:
    """A cell that no spreadsheet runs; `_as_written` gives back what it was."""
    return f"'{value}" if _is_formula(value) else value


def _as_written(cell: Any) -> Any:
    quoted = isinstance(cell, str) and cell.startswith("'") and _is_formula(cell[1:])
    return cell[1:] if quoted else cell


def write_csv(path: Path, table: pd.DataFrame) -> None:
    """A table as CSV with all digits; it appears whole or not at all."""
    import numpy as np

    table = table.rename(columns=_as_text)
    for name, kind in table.dtypes.items():
        if pd.api.types.is_numeric_dtype(kind):
            continue
        if any(map(_is_formula, {word for word in table[name] if isinstance(word, str)})):
            table = table.assign(**{str(name): table[name].map(_as_text)})
    # An import of colour-science switches NumPy to printing floats with 12 digits, and pandas
    # prints as NumPy does.
    with np.printoptions(legacy=False):
        write_whole(path, lambda temporary: table.to_csv(temporary, index=False))


def found_or_kept(path: Path, found: pd.DataFrame) -> pd.DataFrame:
    """What was found from a run's images, written to `path`; what is kept there if nothing was.

    A published run has no images.
    """
    if len(found):
        write_csv(path, found)
    elif path.is_file():
        kept = pd.read_csv(path)
        return kept.map(_as_written).rename(columns=_as_written)
    return found


def write_text(path: Path, text: str) -> None:
    """A text in UTF-8; it appears whole or not at all."""
    write_whole(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def write_run(folder: Path, rows: pd.DataFrame, facts: dict[str, Any]) -> None:
    """Write rows and record. `facts` names at least the experiment.

    The list of an earlier report's files stays, for the next report to know which are stale.
    """
    types = {column: str(kind) for column, kind in rows.dtypes.items()}
    before = read_record(folder)
    files = {REPORT_FILES: before[REPORT_FILES]} if REPORT_FILES in before else {}
    write_csv(folder / ROWS, rows)
    _write_record(folder, {**facts, "types": types, **files})


def read_record(folder: Path) -> dict[str, Any]:
    """The record of a folder; empty where it has none that can be read."""
    try:
        found = json.loads((folder / RECORD).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def add_to_record(folder: Path, facts: dict[str, Any]) -> None:
    """Add to what the record of a run says, or replace it."""
    record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
    _write_record(folder, {**record, **facts})


def _write_record(folder: Path, record: dict[str, Any]) -> None:
    text = json.dumps(record, indent=2, ensure_ascii=False) + "\n"
    write_text(folder / RECORD, text)


def check_run_folder(folder: Path, experiment: str, scale: str) -> None:
    """EnvlightError where a folder holds finished work that a run there would write over: a
    published or joined run, one of another experiment or scale, or files that are no run's."""
    found, works = read_record(folder), is_run_folder(folder)
    if (found or (folder / PACKED_ROWS).is_file()) and not works:
        raise EnvlightError(
            f"{folder}: it holds a run that was published or joined, or one of another version of "
            "the program, which is not measured on; give another folder by --output"
        )
    others = [name for name in (RECORD, ROWS, REPORT) if (folder / name).exists()]
    if others and not works:
        raise EnvlightError(
            f"{folder}: {others[0]} is there and was not written by a run in that folder; give "
            "another folder by --output"
        )
    there = about(found)
    if found and there != [experiment, scale]:
        raise EnvlightError(
            f"{folder}: it holds {' at scale '.join(there)}, not {experiment} at scale {scale}; "
            "give another folder by --output"
        )


def about(record: dict[str, Any]) -> list[str]:
    """The experiment and the scale that a record is of."""
    scale = record.get("scale", {}).get("name") or record.get("request", {}).get("scale")
    return [str(record.get("experiment")), str(scale)]


def merged(before: Sequence[Any], now: Sequence[Any]) -> list[Any]:
    """What stands in either, each once: in the order of `now` where that has all."""
    if set(before) <= set(now):
        return list(dict.fromkeys(now))
    return list(dict.fromkeys([*before, *now]))


def listed_files(record: dict[str, Any], key: str) -> list[str]:
    """The files that a record lists as written; a record that was changed can say anything."""
    names = record.get(key, [])
    return [str(name) for name in names] if isinstance(names, list) else []


def read_run(folder: Path) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Rows and record of a folder; EnvlightError where they are missing or do not fit."""
    packed = folder / PACKED_ROWS
    file = packed if packed.is_file() else folder / ROWS
    try:
        record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        text = pd.read_csv(file, dtype=str, keep_default_na=False, na_filter=False)
        types = record["types"]
        rows = pd.DataFrame({name: _column(text[name], kind) for name, kind in types.items()})
    except FileNotFoundError as error:
        raise EnvlightError(
            f"{folder}: it has no {Path(error.filename).name}; give the folder of a run"
        ) from error
    except UNREADABLE as error:
        raise EnvlightError(
            f"{folder}: {file.name} and {RECORD} do not fit each other ({error}); copy both anew "
            "from the run"
        ) from error
    return rows, record


def _column(text: pd.Series, kind: str) -> pd.Series:
    if kind == "bool":
        return text == "True"
    if kind.startswith("float"):
        return text.map(lambda word: float(word or "nan"))
    if kind.startswith(("int", "uint")):
        return text.map(int)
    text = text.map(_as_written)
    if kind == "object":
        return text.astype(object).where(text != "", None)
    return text.where(text != "")
