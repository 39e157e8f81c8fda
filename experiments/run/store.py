"""Where results are kept: one SQLite file for all runs of a working folder, addressed by content.

A key tells all that determines a result, so that whoever asks for the same finds it: a run is a
selection, the list of its keys, which stands in its own folder. References that runs share, what a
start finds finished, what is left, and a narrower command are one look-up. Nothing is ever removed.

A process that is killed leaves every committed row and none half-written. Any number of runs may
write at the same time, each by short transactions; a run folder has one writer, which holds a lock
that the operating system lets go of when the process ends, however it ends. With each row stands a
hash of it: a row that is not what was written is told, and missing. A power cut may take the last
rows with it, which are measured again: waiting for the disk at every row would take longer than
many a measurement.
"""

import hashlib
import json
import os
import re
import sqlite3
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from itertools import groupby, islice
from pathlib import Path
from typing import Any

from experiments.run.identity import Shared, as_json
from experiments.run.outputs import process_lives
from renderer.image import write_whole
from samplers import EnvlightError

DATABASE, LOCK, PLAN, BESIDE = "results.sqlite", "writer.lock", "plan.json", "store"
REFERENCE, IMAGE, ROW, FEATURES = "reference", "image", "row", "features"
"""Kinds of results: an image has its scores beside it; the rows of a study are whole."""
SCHEMA = (
    "CREATE TABLE IF NOT EXISTS result (key TEXT PRIMARY KEY, kind TEXT NOT NULL, identity TEXT "
    "NOT NULL, result TEXT NOT NULL, scores TEXT NOT NULL, start INTEGER NOT NULL, digest TEXT "
    "NOT NULL) STRICT",
    "CREATE TABLE IF NOT EXISTS shared (key TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT",
    "CREATE TABLE IF NOT EXISTS start (number INTEGER PRIMARY KEY, record TEXT NOT NULL, digest "
    "TEXT NOT NULL) STRICT",
)
VERSION = 3
"""Of the schema; SQLite keeps it with the tables."""
PIXELS = "pixels"
"""What rows call the hash of an image's pixels. It enters no table."""
UNUSABLE = (sqlite3.Error, UnicodeError)
"""What reading raises; the latter where a damaged name stands in SQLite's own message."""
FOLDERS = ("references", "images", "montages")
UNFINISHED = re.compile(r"\..+\.(\d+)\.(exr|png|csv|md|json|tex|svg)")
"""Names under which files are written before they are moved into place."""
AT_ONCE = 500
"""Keys that are looked up by one statement."""


class StoreError(EnvlightError):
    """The results cannot be read or written: no measurement can go on."""


@dataclass(frozen=True, slots=True)
class Planned:
    """A row of a run.

    key : of the image, or of a study's row
    reference : the key of the case's reference; empty for a study's row
    scores, features : keys of what stands in the row besides: the image's scores, and features of
        map and scene
    """

    key: str
    reference: str = ""
    scores: tuple[str, ...] = ()
    features: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Stored:
    """What stands under a key. start : the place in `Store.starts` of the one that measured it"""

    key: str
    kind: str
    identity_text: str
    result_text: str
    scores_text: str
    start: int

    @property
    def identity(self) -> dict[str, Any]:
        """What determined it; hashes stand for what it shares with others: see `Store.shared`."""
        return json.loads(self.identity_text)

    @property
    def result(self) -> dict[str, Any]:
        return json.loads(self.result_text)

    @property
    def scores(self) -> dict[str, dict[str, Any]]:
        """What the image's row has of each score, by the score's key."""
        return json.loads(self.scores_text)


@dataclass
class Selection:
    """What a run folder says of its run: experiment and scale, starts by their numbers, rows."""

    about: list[str] = field(default_factory=list)
    starts: list[int] = field(default_factory=list)
    plan: list[Planned] = field(default_factory=list)


class Store:
    """The results of a working folder, as one of its runs sees them. See `writing`, `reading`.

    folder : of the results, with the images; run : the folder of the run
    """

    def __init__(self, folder: Path, run: Path, connection: sqlite3.Connection) -> None:
        self.folder, self.run = folder, run
        self._connection = connection
        self._damaged: set[str] = set()
        self._shared: dict[str, Any] = {}
        self._known: set[str] = set()
        self._start = 0
        self.selection = _read_selection(run)

    @classmethod
    @contextmanager
    def writing(cls, run: Path, folder: Path | None = None) -> Iterator["Store"]:
        """The store of the run folder `run`, of which this process is the only writer.

        folder : of the results; where none is given, the one beside the run folder

        Raises StoreError where a folder cannot be written or another process writes to the run.
        """
        folder = folder or store_of(run)
        for place in (run, folder):
            try:
                place.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise StoreError(
                    f"{place}: the folder cannot be made ({error.strerror}); give another by "
                    "--output or --store"
                ) from error
        with (
            closing(_connect(run, LOCK, 0.0)) as lock,
            closing(_connect(folder, DATABASE, 60.0)) as connection,
        ):
            _execute(run, lock, "BEGIN EXCLUSIVE")
            _execute(folder, connection, "PRAGMA journal_mode=WAL")
            _execute(folder, connection, "PRAGMA synchronous=NORMAL")
            if _execute(folder, connection, "SELECT 1 FROM sqlite_schema"):
                _check_database(folder, connection)
            for statement in (f"PRAGMA user_version = {VERSION}", *SCHEMA):
                _execute(folder, connection, statement)
            for place in (run, folder):
                _remove_unfinished(place)
            yield cls(folder, run, connection)

    @classmethod
    @contextmanager
    def reading(cls, run: Path, folder: Path | None = None) -> Iterator["Store"]:
        """The store of an existing run folder, also while other processes write to it.

        Raises StoreError where there is none, or none that can be read.
        """
        if folder is None and not (run / PLAN).is_file():
            raise StoreError(f"{run}: no results there; give the folder of a run")
        folder = folder or store_of(run)
        if not (folder / DATABASE).is_file():
            raise StoreError(
                f"{run}: its results are not in {folder}; move them there, or start the run again"
            )
        with closing(_connect(folder, DATABASE, 60.0, "ro")) as connection:
            try:
                connection.execute("SELECT count(*) FROM sqlite_schema")
            except UNUSABLE as error:
                # In a folder that cannot be written SQLite has no place for a log's index, so it
                # must be told that the file will not change.
                if (folder / f"{DATABASE}-wal").exists():
                    raise _unusable(folder, error) from error
                with closing(_connect(folder, DATABASE, 60.0, "ro&immutable=1")) as fixed:
                    _check_database(folder, fixed)
                    yield cls(folder, run, fixed)
                return
            _check_database(folder, connection)
            yield cls(folder, run, connection)

    def get(self, key: str) -> Stored | None:
        """What stands under a key, None where there is nothing whole."""
        return next(iter(self.find([key]).values()), None)

    def find(self, keys: Iterable[str]) -> dict[str, Stored]:
        """What stands under each of the keys that has something whole."""
        return {one.key: one for one in self.each(keys)}

    def each(self, keys: Iterable[str]) -> Iterator[Stored]:
        """The same one after another, of however many keys."""
        left = iter(keys)
        while some := list(islice(left, AT_ONCE)):
            marks = ",".join("?" * len(some))
            yield from self._whole(f"WHERE key IN ({marks})", *some)

    def count(self, *kinds: str) -> int:
        """How many results of these kinds there are."""
        marks = ",".join("?" * len(kinds))
        return self._all(f"SELECT count(*) FROM result WHERE kind IN ({marks})", *kinds)[0][0]

    def results(self, kind: str) -> list[Stored]:
        """All results of a kind, in the order of their keys."""
        return list(self._whole("WHERE kind = ? ORDER BY key", kind))

    def shared(self, key: str) -> Any:
        """The part of identities that a hash stands for; the hash where it is not there."""
        if key not in self._shared:
            found = self._all("SELECT value FROM shared WHERE key = ?", key)
            whole = bool(found) and _hash(found[0][0]) == key
            self._shared[key] = json.loads(found[0][0]) if whole else key
        return self._shared[key]

    def put(
        self,
        kind: str,
        key: str,
        identity: Mapping[str, Any],
        result: dict[str, Any] | None,
        scores: Mapping[str, dict[str, Any]] | None = None,
        shared: Iterable[Shared] = (),
    ) -> None:
        """Commit a finished result. What is there already stays; scores are added to it.

        result : None where there is one, to which only scores are added
        shared : the identities of the scores
        """
        for one in (*identity.values(), *shared):
            if isinstance(one, Shared) and one.key not in self._known:
                self._put_shared(one)
        with self._together():
            before = self.get(key)
            found = dict(scores or {})
            text, words, start = json.dumps(result), as_json(identity), self._start
            if before is not None:
                found = {**before.scores, **found}
                text, words, start = before.result_text, before.identity_text, before.start
            row = _signed(key, kind, words, text, json.dumps(found), start)
            _execute(
                self.folder, self._connection,
                "INSERT OR REPLACE INTO result VALUES (?, ?, ?, ?, ?, ?, ?)", *row,
            )  # fmt: skip

    def _put_shared(self, shared: Shared) -> None:
        for part in shared.value.values():
            if isinstance(part, Shared):
                self._put_shared(part)
        statement = "INSERT OR IGNORE INTO shared VALUES (?, ?)"
        _execute(self.folder, self._connection, statement, shared.key, as_json(shared.value))
        self._known.add(shared.key)

    @contextmanager
    def _together(self) -> Iterator[None]:
        """What is done inside is committed at once or not at all."""
        _execute(self.folder, self._connection, "BEGIN IMMEDIATE")
        try:
            yield
            _execute(self.folder, self._connection, "COMMIT")
        except BaseException:
            with suppress(sqlite3.Error):
                self._connection.rollback()
            raise

    def finished(self, plan: Sequence[Planned]) -> list[bool]:
        """Whether each row of a plan is whole, with all its scores and features."""
        wanted = {one.features for one in plan}
        features = self.find({key for keys in wanted for key in keys})
        there = {keys: all(key in features for key in keys) for keys in wanted}
        scores = {one.key: one.scores for one in plan}
        rows = self.each(one.key for one in plan)
        whole = {one.key for one in rows if _has(one, scores[one.key])}
        return [one.key in whole and there[one.features] for one in plan]

    def rows(self, plan: Sequence[Planned]) -> Iterator[dict[str, Any]]:
        """The whole rows of a plan, in its order: the one place where a row is put together."""
        features = {one.key: one.result for one in self.each(_features(plan))}
        for start in range(0, len(plan), AT_ONCE):
            some = plan[start : start + AT_ONCE]
            found = self.find(one.key for one in some)
            for one in some:
                stored = found.get(one.key)
                if stored is None or not _has(stored, one.scores):
                    continue
                if not all(key in features for key in one.features):
                    continue
                row = {"key": one.key, "reference": one.reference} if one.reference else {}
                row |= stored.result
                row.pop(PIXELS, None)
                scores = stored.scores if one.scores else {}
                for part in (*map(scores.__getitem__, one.scores),
                             *map(features.__getitem__, one.features)):  # fmt: skip
                    row |= part
                yield row

    def begin(self, record: dict[str, Any], about: list[str], plan: list[Planned]) -> None:
        """Note the machine, versions and command of a start, and the rows that it is about."""
        with self._together():
            newest = self._all("SELECT max(number) FROM start")[0][0] or 0
            self._start = newest + 1
            row = self._start, json.dumps(record)
            insert = "INSERT INTO start VALUES (?, ?, ?)"
            _execute(self.folder, self._connection, insert, *row, _hash("start", *map(str, row)))
        starts = [*self.selection.starts, self._start]
        self.selection = Selection(about, starts, plan)
        _write_selection(self.run, self.folder, self.selection)

    @property
    def plan(self) -> list[Planned]:
        """What the newest start is about, in its order."""
        return self.selection.plan

    def starts(self, numbers: Iterable[int] | None = None) -> dict[int, dict[str, Any]]:
        """The records of starts by their numbers, oldest first; of this run's where none is given.

        A result may have been measured by a start of another run.
        """
        wanted = sorted(set(self.selection.starts if numbers is None else numbers))
        found = {}
        for number in wanted:
            for record, digest in self._all(
                "SELECT record, digest FROM start WHERE number = ?", number
            ):
                if digest == _hash("start", str(number), record):
                    found[number] = json.loads(record)
                elif f"start {number}" not in self._damaged:
                    self._damaged.add(f"start {number}")
                    _tell(self.folder, "the record of a start is damaged; it is left out")
        return found

    def _whole(self, condition: str, *values: object) -> Iterator[Stored]:
        """The results that are as they were written; the first that is not is told."""
        for row in self._all(f"SELECT * FROM result {condition}", *values):
            if row == _signed(*row[:-1]):
                yield Stored(*row[:-1])
                continue
            if not self._damaged:
                _tell(
                    self.folder,
                    "stored results are damaged; these are left out, and measured "
                    "again by a new start",
                )
            self._damaged.add(str(row[0]))

    def _all(self, statement: str, *values: object) -> list[tuple]:
        return _execute(self.folder, self._connection, statement, *values)


def store_of(run: Path) -> Path:
    """The folder of a run's results: what its plan names, or the one beside the run folder.

    They are looked for from the run folder first, as both may have moved, and then where they were.
    """
    places = [run / named for named in _read_plan(run).get("store", [])]
    there = (place for place in places if (place / DATABASE).is_file())
    return next(there, (*places, run.absolute().parent / BESIDE)[0])


def is_run_folder(folder: Path) -> bool:
    """Whether runs work in a folder, which tells it from published and joined ones."""
    return (folder / PLAN).is_file()


def _has(stored: Stored, scores: Iterable[str]) -> bool:
    """Whether a result has scores of these keys, which stand nowhere else in its text."""
    return all(f'"{key}"' in stored.scores_text for key in scores)


def _features(plan: Sequence[Planned]) -> set[str]:
    return {key for keys in {one.features for one in plan} for key in keys}


def _read_plan(run: Path) -> dict[str, Any]:
    try:
        found = json.loads((run / PLAN).read_text(encoding="utf-8"))
        content = found.pop("digest"), _hash(as_json(found))
    except (OSError, UnicodeError, ValueError, KeyError, AttributeError, TypeError):
        return {}
    return found if content[0] == content[1] else {}


def _read_selection(run: Path) -> Selection:
    """What a run folder says of its run; nothing, which is told, where that is damaged."""
    found = _read_plan(run)
    if not found:
        if is_run_folder(run):
            _tell(run, "the list of measurements is damaged; give the command of the run again")
        return Selection()
    plan = [
        Planned(key, reference, scores, features)
        for group in found["plan"]
        for reference, scores, features in [
            (group["reference"], tuple(group["scores"]), tuple(group["features"]))
        ]
        for key in group["keys"]
    ]
    return Selection(found["about"], found["starts"], plan)


def _write_selection(run: Path, folder: Path, selection: Selection) -> None:
    groups = groupby(selection.plan, key=lambda one: (one.reference, one.scores, one.features))
    places = [str(folder.absolute())]
    with suppress(ValueError):  # on another drive of Windows
        places.insert(0, os.path.relpath(folder, run))
    content = {
        "store": places,
        "about": selection.about,
        "starts": selection.starts,
        "plan": [
            {
                "reference": reference, "scores": list(scores), "features": list(features),
                "keys": [one.key for one in members],
            }
            for (reference, scores, features), members in groups
        ],
    }  # fmt: skip
    text = as_json({**content, "digest": _hash(as_json(content))})
    try:
        write_whole(run / PLAN, lambda place: place.write_text(text, encoding="utf-8"))
    except EnvlightError as error:
        raise StoreError(str(error)) from error


def _tell(folder: Path, sentence: str) -> None:
    print(f"envlight: {folder}: {sentence}", file=sys.stderr)


def _hash(*words: str) -> str:
    return hashlib.blake2b("\0".join(words).encode(), digest_size=12).hexdigest()


def _signed(*row: Any) -> tuple:
    """A row with its hash behind it."""
    return (*row, _hash(*map(str, row)))


def _check_database(folder: Path, connection: sqlite3.Connection) -> None:
    """Refuse one of another version; tell of one that is damaged."""
    if _execute(folder, connection, "PRAGMA user_version") != [(VERSION,)]:
        raise StoreError(
            f"{folder}: its results are damaged, or of another version of the program; restore "
            f"{DATABASE}, or give another folder by --output"
        )
    if _execute(folder, connection, "PRAGMA quick_check(1)") != [("ok",)]:
        _tell(folder, "the database is damaged; results that are lost are measured again")


def _connect(folder: Path, name: str, timeout: float, mode: str = "rwc") -> sqlite3.Connection:
    """A connection that commits each statement by itself."""
    place = f"{(folder / name).absolute().as_uri()}?mode={mode}"
    try:
        connection = sqlite3.connect(place, timeout=timeout, isolation_level=None, uri=True)
    except sqlite3.Error as error:
        raise _unusable(folder, error) from error
    connection.text_factory = lambda text: text.decode("utf-8", "replace")
    return connection


def _execute(
    folder: Path, connection: sqlite3.Connection, statement: str, *values: object
) -> list[tuple]:
    try:
        return connection.execute(statement, values).fetchall()
    except UNUSABLE as error:
        raise _unusable(folder, error) from error


def _unusable(folder: Path, error: Exception) -> StoreError:
    """One sentence about what SQLite could not do."""
    code = getattr(error, "sqlite_errorname", "")
    if code.startswith("SQLITE_BUSY"):
        return StoreError(
            f"{folder}: another process is writing to it; wait for it to end, or give another "
            "folder by --output"
        )
    if code in ("SQLITE_NOTADB", "SQLITE_CORRUPT") or isinstance(error, UnicodeError):
        return StoreError(
            f"{folder}: its results are damaged ({error}); restore {DATABASE}, or give another "
            "folder by --output"
        )
    return StoreError(
        f"{folder}: the results cannot be read or written ({error}); check the folder's "
        "permissions and the space left, or give another one"
    )


def _remove_unfinished(folder: Path) -> None:
    """Remove what killed processes had begun to write; its rows are missing and come again."""
    patterns = (".*", *(f"{name}/**/.*" for name in FOLDERS))
    for file in (file for pattern in patterns for file in folder.glob(pattern)):
        written = UNFINISHED.fullmatch(file.name)
        if written and not process_lives(int(written[1])) and file.is_file():
            file.unlink(missing_ok=True)
