"""The table of all published folders, `suite.toml` beside them: what each is, and its commands."""

import re
import shlex
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from experiments.run.loaded_run import RECORD, Run, read_record
from samplers import EnvlightError

SUITE = "suite.toml"
LISTS = "lists"
NAMED = re.compile(r"\{([A-Z]+(?:_[A-Z]+)*)\}")


@dataclass(frozen=True)
class PublishedFolder:
    """An entry of the table.

    title : empty where the experiment's says what it is
    runs : words after `envlight run`, of each command
    publish : words after `envlight publish RUN FOLDER`
    some_fail : whether a run with status 1 is published all the same
    needs : names of folders of maps that were not given
    """

    name: str
    title: str
    runs: tuple[tuple[str, ...], ...]
    publish: tuple[str, ...] = ()
    some_fail: bool = False
    needs: tuple[str, ...] = ()

    def is_whole(self, results: Path) -> bool:
        """Whether it is published with all rows that its run planned, or all that did not fail."""
        place = results / self.name
        if not (place / RECORD).is_file():
            return False
        run = Run.load(place)
        return self.some_fail or len(run.rows) >= run.record.get("planned", 0)


def read_suite(results: Path, maps: Mapping[str, str] | None = None) -> list[PublishedFolder]:
    """Read the table beside published folders, in its order; empty where there is none.

    results : folder of all published folders
    maps : folders of maps by the names that commands have for them
    """
    path = results / SUITE
    if not path.is_file():
        return []
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise EnvlightError(f"{path}: {error}; mend this table") from error
    lists = table.pop(LISTS, {})
    return [_entry(path, name, entry, lists, maps or {}) for name, entry in table.items()]


def _entry(
    path: Path, name: str, entry: Any, lists: Mapping[str, str], maps: Mapping[str, str]
) -> PublishedFolder:
    known = {"title", "run", "publish", "some_fail"}
    if not isinstance(entry, dict) or "run" not in entry or set(entry) - known:
        raise EnvlightError(f"{path}: [{name}] takes run, and {', '.join(sorted(known - {'run'}))}")
    runs = [entry["run"]] if isinstance(entry["run"], str) else entry["run"]
    try:
        # A folder of maps stays one word, whatever its name.
        words = [[_filled(word, maps) for word in shlex.split(_filled(run, lists))] for run in runs]
        publish = shlex.split(_filled(entry.get("publish", ""), lists))
    except (AttributeError, TypeError, ValueError) as error:
        raise EnvlightError(f"{path}: [{name}] is no command ({error}); mend this table") from error
    needs = {one for run in [*words, publish] for word in run for one in NAMED.findall(word)}
    return PublishedFolder(
        name, str(entry.get("title", "")), tuple(map(tuple, words)), tuple(publish),
        entry.get("some_fail", False), tuple(sorted(needs)),
    )  # fmt: skip


def _filled(text: str, lists: Mapping[str, str]) -> str:
    """The text with the lists that it names, and those that they name; ValueError for a ring."""
    for _ in range(len(lists) + 1):
        filled = NAMED.sub(lambda found: lists.get(found[1], found[0]), text)
        if filled == text:
            return text
        text = filled
    raise ValueError("lists name one another in a ring")


@cache
def _titles(results: Path) -> dict[str, str]:
    return {Path(one.name).name: one.title for one in read_suite(results)}


def title_of(folder: Path, otherwise: str) -> str:
    """Say what a published folder is: its title in the table beside it or above, or `otherwise`."""
    place = folder.resolve()
    titles = _titles(place.parent) or _titles(place.parent.parent)
    return titles.get(place.name) or otherwise


def whole_of(run: Run) -> Path:
    """The folder around a run's own where a run of the same experiment is there; else its own."""
    around = run.folder.resolve().parent
    same = read_record(around).get("experiment") == run.record["experiment"]
    return around if same else run.folder


@cache
def together(run: Run) -> list[Run]:
    """The run, then those of its experiment that stand in folders inside its own, by name: of other
    sizes, samplers or budgets, with rows of their own. Its report is of all.
    """
    found = (Run.load(file.parent) for file in sorted(run.folder.glob(f"*/{RECORD}")))
    return [run, *(one for one in found if whole_of(one) != one.folder)]
