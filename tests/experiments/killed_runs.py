"""Starts a tiny run over and over, kills it each time, lets it end, and prints what it saw.

A script of its own, because a process that has threads cannot be forked: this one has none, and
its children inherit the compiled kernels. Arguments: folder of maps, folder to work in.
"""

import json
import os
import signal
import sqlite3
import sys
import time
from contextlib import closing
from pathlib import Path

import numpy as np
import OpenImageIO

from experiments import cli
from experiments.scale import SCALES, Scale

KILLS = (signal.SIGKILL, signal.SIGINT) * 4
SCALES["tiny"] = Scale("tiny", 24, 18, 1, 0.5, 64, 16, (4, 8))


def run(maps: Path, folder: Path) -> int:
    """One run by the command line, in this process; its exit status."""
    sys.argv = ["envlight", "run", "table1", "--scale", "tiny", "--environments", str(maps)]
    sys.argv += ["--scenes", "three-boxes", "--samplers", "u*", "--samplers", "m*"]
    sys.argv += ["--threads", "1", "--output", str(folder)]
    try:
        cli.main()
    except SystemExit as end:
        return int(end.code or 0)
    return 0


def start(maps: Path, folder: Path, errors: Path) -> int:
    """The id of a child that runs the same."""
    child = os.fork()
    if child:
        return child
    # A process started in the background inherits that interrupts are ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.dup2(os.open(errors, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
    os._exit(run(maps, folder))


def rows(folder: Path) -> dict[str, float]:
    """When each cell was finished, by key; fails where the database is damaged."""
    if not (folder / "results.sqlite").is_file():
        return {}
    with closing(sqlite3.connect(folder / "results.sqlite")) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        tables = connection.execute("SELECT name FROM sqlite_schema WHERE name = 'cell'")
        found = connection.execute("SELECT key, finished FROM cell") if tables.fetchall() else ()
        return dict(found)


def wait_for(folder: Path, count: int, child: int) -> None:
    """Return when `count` cells are finished, or the child has ended."""
    while os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is None:
        try:
            if len(rows(folder)) >= count:
                return
        except sqlite3.OperationalError:  # the child is just making the database
            pass
        time.sleep(0.001)


def main() -> None:
    maps, place = map(Path, sys.argv[1:])
    output = sys.stdout
    sys.stdout = Path(os.devnull).open("w")  # noqa: SIM115 - for as long as the process lives
    OpenImageIO.attribute("threads", 1)
    assert run(maps, place / "warm") == 0
    begun = time.perf_counter()
    assert run(maps, place / "whole") == 0
    duration = time.perf_counter() - begun

    rng = np.random.default_rng(3)
    folder, errors = place / "killed", place / "errors"
    before: dict[str, float] = {}
    seen = []
    for kill in KILLS:
        child = start(maps, folder, errors)
        # Some cells further, at any moment of the next two. An interrupt waits for one at least:
        # before that the child may still be a copy of this program.
        further = int(rng.integers(kill == signal.SIGINT, 6))
        wait_for(folder, len(before) + further, child)
        time.sleep(rng.uniform(0.0, 2.0) * duration / len(rows(place / "whole")))
        os.kill(child, kill)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        after = rows(folder)
        kept = all(after.get(key) == finished for key, finished in before.items())
        seen.append([kill.name, status, len(after), kept, errors.read_text(encoding="utf-8")])
        before = after
    status = run(maps, folder)
    after = rows(folder)
    kept = all(after.get(key) == finished for key, finished in before.items())
    seen.append(["", status, len(after), kept, ""])
    print(json.dumps(seen), file=output)


if __name__ == "__main__":
    main()
