"""What a run folder holds, as the HTML report needs it: rows, identities, record of starts, images.

Everything comes from the stored rows, never from the present source code, so that a report of an
old run says what was measured then. File names and links of its pages are made here, too.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pandas as pd

from experiments.run.budget import sorted_budgets
from experiments.run.grid import in_fixed_order
from experiments.run.identity import digest
from experiments.run.runner import rows_by_start, rows_of
from experiments.run.store import Store, StoreError


@dataclass(frozen=True, eq=False)
class RunData:
    """The measurements that stand in a run's tables.

    rows : one per finished measurement, in a fixed order
    identities : what determined each of them, by key
    planned : number of measurements that its plan has
    sessions : records of all starts, oldest first
    measuring : of those the ones that measured the rows; another found its plan finished
    """

    folder: Path
    rows: pd.DataFrame
    identities: dict[str, dict[str, Any]]
    planned: int
    sessions: list[dict[str, Any]]
    measuring: list[dict[str, Any]]

    @property
    def missing(self) -> int:
        return self.planned - len(self.rows)

    @property
    def scale(self) -> str:
        return str(self.rows["scale"].iloc[0])

    @property
    def view(self) -> tuple[int, int, int]:
        """Width, height and sub-pixels of the images."""
        width, height, subpixels = self.identities[self.rows["key"].iloc[0]]["case"]["view"]
        return width, height, subpixels

    @property
    def budgets(self) -> list[str]:
        """Smallest first."""
        found = self.rows["budget"].unique()
        return sorted_budgets(list(found))

    def reference(self, key: str) -> Path | None:
        """The reference image that this key's measurement was compared with, where it is kept."""
        row = self.rows[self.rows["key"] == key].iloc[0]
        path = self.folder / "references" / f"{row['reference']}.exr"
        return path if path.is_file() else None

    def image(self, key: str, scene: str, environment: str) -> Path | None:
        """The image of a measurement, where it is kept."""
        place = self.folder / "images" / scene / environment
        return next(place.glob(f"*_{key[:8]}.exr"), None) if place.is_dir() else None


def load_run(folder: Path) -> RunData:
    """Read a run folder; EnvlightError where it holds no finished measurement."""
    with Store.reading(folder) as store:
        plan, sessions = store.plan, list(store.starts().values())
        rows = in_fixed_order(rows_of(store))
        if rows.empty:
            raise StoreError(
                f"{folder}: no measurement of its newest start is finished; let the run go on first"
            )
        found = store.find(rows["key"])
        identities = {key: store.identity(one) for key, one in found.items()}
        measuring = list(rows_by_start(store, rows["key"])[1].values())
    return RunData(folder, rows, identities, len(plan), sessions, measuring)


def slug(name: str) -> str:
    """A file name, without suffix, for any text; different texts give different names."""
    plain = re.sub(r"[^A-Za-z0-9.-]+", "_", name).strip("._")
    return plain if plain == name else f"{plain[:60]}-{digest(name)[:6]}"


def quoted(path: str) -> str:
    """A relative path as it stands in a link."""
    return quote(path, safe="/")
