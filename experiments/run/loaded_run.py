"""A run as its folder tells it, by rows and record: enough to make every report again.

`measurements.csv` holds the finished rows with all digits, or `measurements.csv.gz` where they
are published; `run.json` says which experiment they belong to, what was planned, on which
machine, by which versions and command, and the types of the columns, so that what is read is what
was written.

In every CSV file a text that a spreadsheet would take for a formula begins with an apostrophe more
than it has; numbers stand as they are.
"""

import gzip
import html
import json
import re
import sys
import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.run.budget import Budget
from experiments.run.store import is_run_folder
from renderer.image import write_whole
from samplers import EnvlightError, sampler_labels
from samplers.files.image_file import read_radiance

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
    as -0.5, are none.
    """
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
    published or joined run, one of another experiment or scale, or files that are no run's.
    """
    found = read_record(folder)
    names = (PACKED_ROWS, RECORD, ROWS, REPORT)
    others = [name for name in names if (folder / name).exists()]
    if others and not is_run_folder(folder):
        raise EnvlightError(
            f"{folder}: {others[0]} is there and was not written by a run in that folder, but "
            "published, joined or made otherwise; give another folder by --output"
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


_SHARE = r", \d+ of \d+ threads.*$"
"""The share that a row's measurement had of a machine, behind the processor's name."""


@lru_cache(maxsize=1 << 16)
def _tell(path: Path, error: str) -> None:
    """Say once that an image cannot be read, and how it comes again."""
    key = path.stem.rpartition("_")[2]
    where = f"images/{key[:2]}/{key}*.exr"
    again = f"; without {where} in its store, the run's command renders it again"
    said = error.removesuffix("; fetch it again") + "; it is left out of all pictures"
    print(f"envlight: {said}{again if path.parent.name != 'references' else ''}", file=sys.stderr)


@dataclass(frozen=True, eq=False)
class Run:
    """What a folder holds of a run.

    folder : where tables and plots go
    rows : one per finished measurement of its starts, in a fixed order; those of a grid have the
        `key` of their image and the key `reference` of their case's reference
    record : `experiment` and `machine`, the record of the start; of a grid that of the start that
        measured last, with the time of the first. Of a grid also `scale` with name, width, height
        and subpixels; `samplers` and `budgets` in display order; `labels` of samplers in files; the
        number of `planned` measurements; and `missing` cases by sampler. Of a study `request`. Of a
        join, and of a grid that went on at another commit, `parts`; of a join how many `joined`.
    """

    folder: Path
    rows: pd.DataFrame
    record: dict[str, Any]

    @classmethod
    def load(cls, folder: Path) -> "Run":
        """The run that a folder holds; EnvlightError where it holds none."""
        rows, record = read_run(folder)
        for name, label in record.get("labels", {}).items():
            sampler_labels().setdefault(name, label)
        return cls(folder, rows, record)

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r}, {self.record['experiment']}, {len(self.rows)} rows)"

    def _repr_html_(self) -> str:
        return f"<p>{html.escape(repr(self))}</p>{self.rows._repr_html_()}"  # type: ignore[operator]

    @property
    def packed(self) -> bool:
        """Whether the rows are packed, as in the folders that `envlight publish` makes."""
        return (self.folder / PACKED_ROWS).is_file()

    @property
    def samplers(self) -> list[str]:
        return self.record["samplers"]

    @property
    def budgets(self) -> list[str]:
        return self.record["budgets"]

    @property
    def parts(self) -> list[dict[str, Any]]:
        """How many `rows` were measured from which start on, by which (last) command and commit."""
        return self.record.get("parts", [{**self.record["machine"], "rows": len(self.rows)}])

    @property
    def commits(self) -> dict[str, int]:
        """How many rows each commit measured, oldest first."""
        rows: Counter[str] = Counter()
        for part in self.parts:
            rows[str(part["commit"] or "unknown")] += part["rows"]
        return rows

    @property
    def processors(self) -> list[str]:
        """What measured the rows, most rows first; where they do not tell, the record's."""
        if "machine" not in self.rows:
            return [self.record["machine"]["processor"]]
        counts = self.rows["machine"].str.replace(_SHARE, "", regex=True).value_counts()
        return list(counts.index)

    @property
    def timed(self) -> pd.Series:
        """Whether each row's budget is one of seconds."""
        return self.rows["budget"].map(lambda budget: Budget.parse(budget).timed)

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows of the images of a grid."""
        return self.record["scale"]["width"], self.record["scale"]["height"]

    @property
    def image_size(self) -> str:
        """Pixels of a grid's images, as "640×480"."""
        return "{}×{}".format(*self.size)

    def at(self, budget: str) -> pd.DataFrame:
        """The rows at one budget."""
        return self.rows[self.rows["budget"] == budget]

    def kept_image(self, row: pd.Series) -> Path | None:
        """The image of a row, linear, in OpenEXR, where it is kept."""
        place = self.folder / "images" / row["scene"] / row["environment"]
        return next(place.glob(f"*_{row['key'][:8]}.exr"), None) if place.is_dir() else None

    def kept_reference(self, row: pd.Series) -> Path | None:
        """The reference image of a row's case, where it is there."""
        path = self.folder / "references" / f"{row['reference']}.exr"
        return path if path.is_file() else None

    def read(self, path: Path | None) -> NDArray[np.float32] | None:
        """A kept image; None where there is none, or where it cannot be read, which is told."""
        try:
            return None if path is None else read_radiance(path)
        except EnvlightError as error:
            _tell(path, str(error))
            return None


def load_run(folder: str | Path) -> Run:
    """The run in a folder: rows, record, kept images. EnvlightError where there is none."""
    return Run.load(Path(folder))
