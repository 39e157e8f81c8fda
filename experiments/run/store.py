"""Where results are kept: one SQLite file per run folder, a row committed as its measurement ends.

A process that is killed leaves every committed row and none half-written; the next start finds
them by key and measures only the rest. One process writes at a time: it holds a lock that the
operating system lets go of when the process ends, however it ends. With each row stands a hash of
it: a row that is not what was written is told, and missing.
"""

import hashlib
import json
import math
import re
import sqlite3
import sys
import time
from bisect import bisect
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from samplers import EnvlightError

DATABASE = "results.sqlite"
LOCK = "writer.lock"
TABLES = ("reference", "image", "score", "row")
"""A study's rows are whole; those of a grid are an image's row and its scores."""
SCHEMA = (
    *(
        f"CREATE TABLE IF NOT EXISTS {table} (key TEXT PRIMARY KEY, identity TEXT NOT NULL, "
        "result TEXT NOT NULL, finished REAL NOT NULL, digest TEXT NOT NULL) STRICT"
        for table in TABLES
    ),
    "CREATE TABLE IF NOT EXISTS session (started REAL PRIMARY KEY, record TEXT NOT NULL, "
    "digest TEXT NOT NULL) STRICT",
    "CREATE TABLE IF NOT EXISTS plan (position INTEGER PRIMARY KEY, key TEXT NOT NULL, "
    "reference TEXT NOT NULL, scores TEXT NOT NULL, digest TEXT NOT NULL) STRICT",
)
VERSION = 2
"""Of the schema; SQLite keeps it with the tables."""
PIXELS = "pixels"
"""What rows call the hash of an image's pixels. It enters no table."""
UNUSABLE = (sqlite3.Error, UnicodeError)
"""What reading raises; the latter where a damaged name stands in SQLite's own message."""
FOLDERS = ("references", "images", "montages")
UNFINISHED = re.compile(r"\..+\.\d+\.(exr|png|csv|md|json|tex|svg)")
"""Names under which files are written before they are moved into place."""


class StoreError(EnvlightError):
    """The results cannot be read or written: no measurement can go on."""


@dataclass(frozen=True)
class Planned:
    """A row that a start is about.

    key : of the image, or of a study's row
    reference : the key of the case's reference
    scores : the key of the score by each metric, by the metric's name
    """

    key: str
    reference: str = ""
    scores: dict[str, str] = field(default_factory=dict)


class Store:
    """The results of one run folder. Use `writing` or `reading` to open one."""

    def __init__(self, folder: Path, connection: sqlite3.Connection) -> None:
        self.folder = folder
        self._connection = connection
        self._damaged: set[tuple[str, Any]] = set()

    @classmethod
    @contextmanager
    def writing(cls, folder: Path) -> Iterator["Store"]:
        """The store of `folder`, made where it is missing, for this process alone.

        Raises StoreError where the folder cannot be written or another process writes to it.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StoreError(
                f"{folder}: the folder cannot be made ({error.strerror}); give another by --output"
            ) from error
        with (
            closing(_connect(folder, LOCK, 0.0)) as lock,
            closing(_connect(folder, DATABASE, 30.0)) as connection,
        ):
            _execute(folder, lock, "BEGIN EXCLUSIVE")
            _execute(folder, connection, "PRAGMA journal_mode=WAL")
            _execute(folder, connection, "PRAGMA synchronous=FULL")
            if _execute(folder, connection, "SELECT 1 FROM sqlite_schema"):
                _check_version(folder, connection)
            for statement in (f"PRAGMA user_version = {VERSION}", *SCHEMA):
                _execute(folder, connection, statement)
            _remove_unfinished(folder)
            yield cls(folder, connection)

    @classmethod
    @contextmanager
    def reading(cls, folder: Path) -> Iterator["Store"]:
        """The store of an existing run folder, also while another process writes to it.

        Raises StoreError where there is none, or none that can be read.
        """
        if not (folder / DATABASE).is_file():
            raise StoreError(f"{folder}: no results there; give the folder of a run")
        with closing(_connect(folder, DATABASE, 30.0, "ro")) as connection:
            try:
                connection.execute("SELECT count(*) FROM sqlite_schema")
            except UNUSABLE as error:
                # In a folder that cannot be written SQLite has no place for a log's index, so it
                # must be told that the file will not change.
                if (folder / f"{DATABASE}-wal").exists():
                    raise _unusable(folder, error) from error
                with closing(_connect(folder, DATABASE, 30.0, "ro&immutable=1")) as fixed:
                    _check_version(folder, fixed)
                    yield cls(folder, fixed)
                return
            _check_version(folder, connection)
            yield cls(folder, connection)

    def get(self, table: str, key: str) -> dict[str, Any] | None:
        """The result stored under a key, None where there is none."""
        assert table in TABLES
        found = self._whole(table, "WHERE key = ?", key)
        return json.loads(found[0][2]) if found else None

    def identity(self, table: str, key: str) -> dict[str, Any] | None:
        """What determined the result stored under a key, None where there is none."""
        assert table in TABLES
        found = self._whole(table, "WHERE key = ?", key)
        return json.loads(found[0][1]) if found else None

    def put(self, table: str, key: str, identity: dict[str, Any], result: dict[str, Any]) -> None:
        """Commit a finished result. A key that is there already is an error, never overwritten,
        unless it was found damaged."""
        assert table in TABLES
        row = _signed(table, key, json.dumps(identity), json.dumps(result), time.time())
        insert = "INSERT OR REPLACE" if (table, key) in self._damaged else "INSERT"
        statement = f"{insert} INTO {table} VALUES (?, ?, ?, ?, ?)"
        _execute(self.folder, self._connection, statement, *row)

    @contextmanager
    def together(self) -> Iterator[None]:
        """What is put inside is committed at once or not at all."""
        _execute(self.folder, self._connection, "BEGIN")
        try:
            yield
        except BaseException:
            self._connection.rollback()
            raise
        _execute(self.folder, self._connection, "COMMIT")

    def results(self, table: str) -> list[tuple[str, dict[str, Any], dict[str, Any]]]:
        """Key, identity and result of all that is in a table, in the order of the keys."""
        assert table in TABLES
        found = self._whole(table, "ORDER BY key")
        return [(key, json.loads(one), json.loads(result)) for key, one, result, _ in found]

    def measured(self, planned: Planned) -> dict[str, Any] | None:
        """A measurement's row: its image's and all its scores; None while one is missing."""
        image = self.get("image", planned.key)
        if image is None:
            return None
        scores = [self.get("score", key) for key in planned.scores.values()]
        if None in scores:
            return None
        image = {name: value for name, value in image.items() if name != PIXELS}
        row = {"key": planned.key, "reference": planned.reference, **image}
        for score in scores:
            row |= score or {}
        return row

    def begin_session(self, record: dict[str, Any], plan: Sequence[Planned]) -> None:
        """Note the machine, versions and command of a start, and the keys that it is about."""
        execute = self._connection.execute
        try:
            with self._connection:
                execute("BEGIN")
                session = _signed("session", self._now(), json.dumps(record))
                execute("INSERT INTO session VALUES (?, ?, ?)", session)
                execute("DELETE FROM plan")
                self._connection.executemany(
                    "INSERT INTO plan VALUES (?, ?, ?, ?, ?)",
                    (
                        _signed("plan", place, one.key, one.reference, json.dumps(one.scores))
                        for place, one in enumerate(plan)
                    ),
                )
        except sqlite3.Error as error:
            raise _unusable(self.folder, error) from error

    def _now(self) -> float:
        """The time, or the next float where a start has that already: clocks can be set back."""
        now = time.time()
        while self._all("SELECT 1 FROM session WHERE started = ?", now):
            now = math.nextafter(now, math.inf)
        return now

    def sessions(self) -> list[dict[str, Any]]:
        """The records of all starts, oldest first."""
        return [json.loads(record) for _, record in self._whole("session", "ORDER BY rowid")]

    def finished_in(self) -> dict[str, int]:
        """Of each finished image of the newest plan the place in `sessions` of the start that
        finished it, by the clock."""
        starts = self._whole("session", "ORDER BY rowid")
        places = sorted((started, place) for place, (started, _) in enumerate(starts))
        found = self._whole("image", "WHERE key IN (SELECT key FROM plan)")
        before = {key: bisect(places, (finished, math.inf)) for key, _, _, finished in found}
        # None is before where clocks were set back.
        return {key: places[count - 1][1] if count else 0 for key, count in before.items()}

    def plan(self) -> list[Planned]:
        """What the newest start is about, in its order."""
        found = self._whole("plan", "ORDER BY position")
        return [Planned(key, reference, json.loads(scores)) for _, key, reference, scores in found]

    def _whole(self, table: str, condition: str, *values: object) -> list[tuple[Any, ...]]:
        """The rows of a table that are as they were written; the first that is not is told."""
        whole = []
        for row in self._all(f"SELECT * FROM {table} {condition}", *values):
            if row == _signed(table, *row[:-1]):
                whole.append(row[:-1])
                continue
            if all(table != known for known, _ in self._damaged):
                print(f"envlight: {self.folder}: {_DAMAGED[table]}", file=sys.stderr)
            self._damaged |= {(table, row[0]), *((table, value) for value in values)}
        return whole

    def _all(self, statement: str, *values: object) -> list[tuple]:
        return _execute(self.folder, self._connection, statement, *values)


_DAMAGED = {
    **dict.fromkeys(
        TABLES, "stored results are damaged; these are left out, and measured again by a new start"
    ),
    "session": "the record of a start is damaged; what it measured is counted to another",
    "plan": "the list of measurements is damaged; give the command of the run again",
}


def _signed(table: str, *row: Any) -> tuple:
    """A row with its hash behind it."""
    text = "\0".join((table, *map(repr, row)))
    return (*row, hashlib.blake2b(text.encode(), digest_size=12).hexdigest())


def _check_version(folder: Path, connection: sqlite3.Connection) -> None:
    if _execute(folder, connection, "PRAGMA user_version") != [(VERSION,)]:
        raise StoreError(
            f"{folder}: its results are damaged, or of another version of the program; restore "
            f"{DATABASE}, or give another folder by --output"
        )


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
    except sqlite3.IntegrityError:
        raise
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
    """Remove what a killed process had begun to write; its rows are missing and come again."""
    patterns = (".*", *(f"{name}/**/.*" for name in FOLDERS))
    for file in (file for pattern in patterns for file in folder.glob(pattern)):
        if UNFINISHED.fullmatch(file.name) and file.is_file():
            file.unlink(missing_ok=True)
