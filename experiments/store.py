"""Where results are kept: one SQLite file per run folder, a row committed as its cell ends.

A process that is killed leaves every committed row and none half-written; the next start finds
them by key and measures only the rest. One process writes at a time: it holds a lock that the
operating system lets go of when the process ends, however it ends.
"""

import json
import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from samplers import EnvlightError

DATABASE = "results.sqlite"
LOCK = "writer.lock"
SCHEMA = """
CREATE TABLE IF NOT EXISTS cell (
    key TEXT PRIMARY KEY, identity TEXT NOT NULL, result TEXT NOT NULL, finished REAL NOT NULL
) STRICT;
CREATE TABLE IF NOT EXISTS reference (
    key TEXT PRIMARY KEY, identity TEXT NOT NULL, result TEXT NOT NULL, finished REAL NOT NULL
) STRICT;
CREATE TABLE IF NOT EXISTS session (
    started REAL PRIMARY KEY, record TEXT NOT NULL
) STRICT;
"""


class Store:
    """The results of one run folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._connection = sqlite3.connect(folder / DATABASE, timeout=30.0)
        self._connection.execute("PRAGMA journal_mode=WAL")
        self._connection.execute("PRAGMA synchronous=FULL")
        self._connection.executescript(SCHEMA)

    @classmethod
    @contextmanager
    def writing(cls, folder: Path) -> Iterator["Store"]:
        """The store of `folder`, made where it is missing, for this process alone.

        Raises EnvlightError where the folder cannot be written or another process writes to it.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
            lock = sqlite3.connect(folder / LOCK, timeout=0.0, isolation_level=None)
            lock.execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:
            reason = "another process is writing to it" if "locked" in str(error) else str(error)
            raise EnvlightError(
                f"{folder}: {reason}; wait for it to end, or give another folder by --output"
            ) from error
        except OSError as error:
            raise EnvlightError(
                f"{folder}: cannot be written ({error.strerror}); give another folder by --output"
            ) from error
        try:
            store = cls(folder)
            try:
                yield store
            finally:
                store.close()
        finally:
            lock.close()

    @classmethod
    @contextmanager
    def reading(cls, folder: Path) -> Iterator["Store"]:
        """The store of an existing run folder, also while another process writes to it."""
        if not (folder / DATABASE).is_file():
            raise EnvlightError(f"{folder}: no results there; give the folder of a run")
        store = cls(folder)
        try:
            yield store
        finally:
            store.close()

    def close(self) -> None:
        self._connection.close()

    def get(self, table: str, key: str) -> dict[str, Any] | None:
        """The result stored under a key, None where there is none."""
        assert table in ("cell", "reference")
        row = self._connection.execute(
            f"SELECT result FROM {table} WHERE key = ?", (key,)
        ).fetchone()
        return json.loads(row[0]) if row else None

    def put(self, table: str, key: str, identity: dict[str, Any], result: dict[str, Any]) -> None:
        """Commit a finished result. A key that is there already is an error, never overwritten."""
        assert table in ("cell", "reference")
        with self._connection:
            self._connection.execute(
                f"INSERT INTO {table} VALUES (?, ?, ?, ?)",
                (key, json.dumps(identity), json.dumps(result, allow_nan=True), time.time()),
            )

    def rows(self) -> list[tuple[str, dict[str, Any], dict[str, Any]]]:
        """Key, identity and result of all finished cells, in the order of their keys."""
        found = self._connection.execute("SELECT key, identity, result FROM cell ORDER BY key")
        return [(key, json.loads(identity), json.loads(result)) for key, identity, result in found]

    def record_session(self, record: dict[str, Any]) -> None:
        """Note the machine, versions and command of a start."""
        with self._connection:
            self._connection.execute(
                "INSERT OR REPLACE INTO session VALUES (?, ?)", (time.time(), json.dumps(record))
            )

    def sessions(self) -> list[dict[str, Any]]:
        """The records of all starts, oldest first."""
        found = self._connection.execute("SELECT record FROM session ORDER BY started")
        return [json.loads(record) for (record,) in found]
