"""A run as its rows and record tell it: what every report is made from."""

import html
import sys
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.run.budget import Budget
from experiments.run.record import PACKED_ROWS, read_run
from samplers import EnvlightError
from samplers.files.image_file import read_radiance

_SHARE = r", \d+ of \d+ threads.*$"
"""The share that a row's measurement had of a machine, behind the processor's name."""


@lru_cache(maxsize=1 << 16)
def _can_be_read(path: Path, modified: int) -> bool:
    """Whether a kept image is whole; one that is not is told, and no picture has it."""
    try:
        read_radiance(path)
    except EnvlightError as error:
        _tell(str(error))
        return False
    return True


def _whole(path: Path | None) -> Path | None:
    return path if path and _can_be_read(path, path.stat().st_mtime_ns) else None


@lru_cache(maxsize=1 << 16)
def _tell(error: str) -> None:
    """Say once that an image cannot be read."""
    print(f"envlight: {error}; it is left out of all pictures", file=sys.stderr)


@dataclass(frozen=True, eq=False)
class Run:
    """What a folder holds of a run.

    folder : where tables and plots go
    rows : one per finished measurement of its starts, in a fixed order; those of a grid have the
        `key` of their image and the key `reference` of their case's reference
    record : `experiment` and `machine`, the record of the start; of a grid that of the start that
        measured last, with the time of the first. Of a grid also `scale` with name, width, height
        and subpixels; `samplers` and `budgets` in display order; the number of `planned`
        measurements; and `missing` cases by sampler. Of a study `request`. Of a join, and of a grid
        that went on at another commit, `parts`; of a join how many runs were `joined`.
    """

    folder: Path
    rows: pd.DataFrame
    record: dict[str, Any]

    @classmethod
    def load(cls, folder: Path) -> "Run":
        """The run that a folder holds; EnvlightError where it holds none."""
        return cls(folder, *read_run(folder))

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
    def image_size(self) -> str:
        """Pixels of a grid's images, as "640×480"."""
        return f"{self.record['scale']['width']}×{self.record['scale']['height']}"

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
            _tell(str(error))
            return None

    def image(self, row: pd.Series) -> Path | None:
        """The image of a row, where it is kept and can be read."""
        return _whole(self.kept_image(row))

    def reference(self, row: pd.Series) -> Path | None:
        """The reference image of a row's case, where it is there and can be read."""
        return _whole(self.kept_reference(row))
