"""What of a run is enough to make its tables and plots again: its rows and its record.

`measurements.csv` holds the finished rows with all digits, or `measurements.csv.gz` where they
are published; `run.json` says which experiment they belong to, what was planned, on which
machine, by which versions and command, and the types of the columns, so that what is read is what
was written.
"""

import gzip
import json
import zlib
from pathlib import Path
from typing import Any

import pandas as pd

from renderer.image import write_whole
from samplers import EnvlightError

ROWS, PACKED_ROWS, RECORD = "measurements.csv", "measurements.csv.gz", "run.json"
UNREADABLE = (
    ValueError, KeyError, TypeError, EOFError, gzip.BadGzipFile, zlib.error, pd.errors.ParserError,
)  # fmt: skip


def write_csv(path: Path, table: pd.DataFrame) -> None:
    """A table as CSV with all digits; it appears whole or not at all."""
    import numpy as np

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
        return pd.read_csv(path)
    return found


def write_text(path: Path, text: str) -> None:
    """A text in UTF-8; it appears whole or not at all."""
    write_whole(path, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def write_run(folder: Path, rows: pd.DataFrame, facts: dict[str, Any]) -> None:
    """Write rows and record. `facts` names at least the experiment."""
    types = {column: str(kind) for column, kind in rows.dtypes.items()}
    text = json.dumps({**facts, "types": types}, indent=2, ensure_ascii=False) + "\n"
    write_csv(folder / ROWS, rows)
    write_text(folder / RECORD, text)


def add_to_record(folder: Path, facts: dict[str, Any]) -> None:
    """Add to what the record of a run says, or replace it."""
    record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
    text = json.dumps({**record, **facts}, indent=2, ensure_ascii=False) + "\n"
    write_text(folder / RECORD, text)


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
    if kind == "object":
        return text.astype(object).where(text != "", None)
    return text.where(text != "")
