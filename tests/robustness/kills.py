"""Runs that are killed at random moments, and go on until they are done.

Each run begins in an empty folder, is killed once to three times by SIGKILL or SIGINT, and then
left to end, by each executor. An interrupt goes to all its processes, as from a terminal; SIGKILL
to the run alone, whose workers must then end themselves. A moment is drawn by its phase first, so
that short phases are hit as well: start-up, the rendering of a reference, the measuring and
committing of a measurement, the writing of the report. After each kill the store is checked, and
at the end every file against those of a run that nobody killed. Most starts are copies of this
process, whose kernels are loaded; every start that is to be killed in its start-up is a process of
its own.

This process must have no other threads, since it is copied.
"""

import json
import os
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from experiments.run import INTERRUPTED
from experiments.run.executors import KINDS
from experiments.run.rendering import MACHINE_COLUMNS
from experiments.run.store import DATABASE, store_of
from tests.robustness.watched_run import MEASUREMENT, PHASES, START, Marker, run, write_maps

SIGNALS = (signal.SIGKILL, signal.SIGINT)
SHARES = (0.15, 0.25, 0.4, 0.2)
"""How many of the kills aim at each phase."""
COLD_START = {START: 2.0}
"""Seconds in which libraries are loaded and a start that is not a copy is hit."""
MOST_KILLS = 3
GONE_SECONDS = 60.0
"""So long after a kill its workers may still be there: Dask's look for their scheduler first."""
TABLES = ("measurements.csv", "summary.csv")
TIMED = (*MACHINE_COLUMNS, "prepare_ms", "render_ms")
"""Columns of the rows and of the summary."""
PROGRESS = re.compile(r"envlight: .*, \d+ s")
"""What is said every half minute."""


@dataclass(frozen=True)
class Kill:
    """One kill, and what was found after it.

    phase : what the run was doing; status : with which it ended, negative for a signal
    finished : measurements stored after it
    lost, again, twice, corrupt : finished measurements that were gone, that were measured again,
        that two rows stand for; files and rows that are damaged
    orphans : its processes that had not ended after GONE_SECONDS
    told : whether it said what an interrupted run must say, and nothing else
    said : the beginning of what it said where that was not it"""

    executor: str
    run: int
    number: int
    signal: str
    phase: str
    status: int
    finished: int
    lost: int
    again: int
    twice: int
    corrupt: int
    orphans: int
    told: bool
    said: str


@dataclass(frozen=True)
class End:
    """How a run ended that was killed before: all of it must equal a run that never was.

    table : whether the tables are equal byte for byte, timed columns left out
    files : whether all images are
    leftovers : files that no finished run has"""

    executor: str
    run: int
    kills: int
    status: int
    finished: int
    lost: int
    again: int
    table: bool
    files: bool
    leftovers: int


def harm(kills: list[Kill], ends: list[End]) -> pd.DataFrame:
    """How many runs and kills, then how often each thing was seen that must not be, by executor."""
    struck, ended = pd.DataFrame(kills), pd.DataFrame(ends)
    columns = {
        kind: _counts(struck[struck["executor"] == kind], ended[ended["executor"] == kind])
        for kind in KINDS
        if kind in set(ended["executor"])
    }
    return pd.DataFrame(columns).rename_axis("what").reset_index()


def _counts(struck: pd.DataFrame, ended: pd.DataFrame) -> dict[str, int]:
    counts = {
        "runs": len(ended),
        "kills": len(struck),
        "finished measurements lost": struck["lost"].sum() + ended["lost"].sum(),
        "finished measurements measured again": struck["again"].sum() + ended["again"].sum(),
        "measurements stored twice": struck["twice"].sum(),
        "damaged rows, stores or images": struck["corrupt"].sum(),
        "processes left over": struck["orphans"].sum(),
        "ends without the sentence that is owed": (~struck["told"]).sum(),
        "runs that did not end with status 0": (ended["status"] != 0).sum(),
        "tables that differ from those of a run never killed": (~ended["table"]).sum(),
        "runs with an image that differs": (~ended["files"]).sum(),
        "files left over": ended["leftovers"].sum(),
    }
    return {what: int(n) for what, n in counts.items()}


class Campaign:
    """Kills of runs by one executor, in a folder of its own.

    told : called with each kill and each end"""

    def __init__(
        self, place: Path, executor: str, seed: int, told: Callable[[Kill | End], None]
    ) -> None:
        self._place, self._executor, self._told = place, executor, told
        self._rng = np.random.default_rng(seed)
        self._maps, self._whole = place / "maps", place / "whole" / "run"
        self._maps.mkdir(parents=True)
        write_maps(self._maps)
        self._marker = Marker(place / "marker")
        self._errors = place / "errors"
        assert run(self._maps, self._whole, self._marker) == 0  # loads what copies need
        self._marker.clear()
        self._longest = self._watched(place / "watched" / "run") | COLD_START
        self._entries = {phase: self._marker.entries(phase) for phase in PHASES}

    def one_run(self, number: int) -> None:
        """A run that is killed, again and again, and then ends."""
        # Runs beside each other share results, so each has a folder around it.
        folder = self._place / "killed" / "run"
        shutil.rmtree(folder.parent, ignore_errors=True)
        before: dict[str, float] = {}
        hits, kills = 0, int(self._rng.integers(1, MOST_KILLS + 1))
        for count in range(kills):
            before, hit = self._kill_once(folder, number, count, before)
            while not hit and count == 0:  # it ended before its moment: once more from the start
                shutil.rmtree(folder.parent, ignore_errors=True)
                before, hit = self._kill_once(folder, number, count, {})
            if not hit:
                break
            hits += 1
        child = self._start(folder, cold=False)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        after, _, _ = self._rows(folder)
        lost, again = _changes(before, after)
        files, whole = _files(folder), _files(self._whole)
        self._told(
            End(
                self._executor, number, hits, status, len(after), lost, again,
                all(_untimed(folder / name) == _untimed(self._whole / name) for name in TABLES),
                {n: c for n, c in files.items() if _is_image(n)}
                == {n: c for n, c in whole.items() if _is_image(n)},
                len(files.keys() - whole.keys()),
            )
        )  # fmt: skip

    def _watched(self, folder: Path) -> dict[str, float]:
        """Let a run end: the longest time spent in each phase before one was entered again."""
        child = self._start(folder, cold=False)
        longest: dict[str, float] = {}
        state, since = (START, 0), time.perf_counter()
        while not _ended(child):
            phase = self._marker.phase or START
            longest[phase] = max(longest.get(phase, 0.0), time.perf_counter() - since)
            if (phase, self._marker.entries(phase)) != state:
                state, since = (phase, self._marker.entries(phase)), time.perf_counter()
            time.sleep(0.0002)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
        return longest

    def _kill_once(
        self, folder: Path, number: int, count: int, before: dict[str, float]
    ) -> tuple[dict[str, float], bool]:
        """Start or go on, kill, look: when each was finished, and whether the kill hit."""
        aim = PHASES[int(self._rng.choice(len(PHASES), p=SHARES))]
        left = {MEASUREMENT: self._entries[MEASUREMENT] - len(before)}.get(aim, self._entries[aim])
        entry = int(self._rng.integers(1, max(left, 1) + 1))
        delay = float(self._rng.uniform(0.0, self._longest[aim]))
        kill = SIGNALS[int(self._rng.integers(2))]
        self._marker.clear()
        child = self._start(folder, cold=aim == START)
        while not _ended(child) and self._marker.entries(aim) < entry:
            time.sleep(0.0002)
        time.sleep(delay)
        if kill == signal.SIGINT:
            os.killpg(child, kill)
        else:
            os.kill(child, kill)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        hit = status != 0  # otherwise it had done all before the signal came
        orphans = _left_over(child)
        after, twice, corrupt = self._rows(folder)
        whole = _files(self._whole.parent)
        corrupt += sum(
            content != whole.get(name)
            for name, content in _files(folder.parent).items()
            if _is_image(name)
        )
        if not hit:
            return after, hit
        lost, again = _changes(before, after)
        errors = self._errors.read_text(encoding="utf-8")
        told = _is_told(status, kill, errors)
        phase = self._marker.phase or START
        self._told(
            Kill(
                self._executor, number, count, kill.name, phase, status, len(after), lost, again,
                twice, corrupt, orphans, told, "" if told else errors[-500:],
            )
        )  # fmt: skip
        return after, hit

    def _start(self, folder: Path, cold: bool) -> int:
        """The id of a process that runs in `folder`, the first of a group of its own; what it says
        on stderr goes to a file."""
        errors = os.open(self._errors, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        try:
            if cold:
                module = "tests.robustness.watched_run"
                place = [str(self._maps), str(folder), str(self._place / "marker"), self._executor]
                command = [sys.executable, "-m", module, *place]
                started = subprocess.Popen(
                    command, stdout=nowhere, stderr=errors, start_new_session=True
                )
                return started.pid
            child = os.fork()
            if child:
                return child
            os.setsid()
            signal.signal(signal.SIGINT, signal.default_int_handler)
            os.dup2(nowhere, 1)
            os.dup2(errors, 2)
            os._exit(run(self._maps, folder, self._marker, self._executor))
        finally:
            os.close(errors)
            os.close(nowhere)

    def _rows(self, folder: Path) -> tuple[dict[str, float], int, int]:
        """The start that finished each measurement, by key; measurements stored twice; damaged
        rows.

        A copy is looked at, since looking would mend what the next start must mend itself."""
        copy = self._place / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        copy.mkdir()
        folder = store_of(folder)
        for suffix in ("", "-wal"):
            if (folder / f"{DATABASE}{suffix}").is_file():
                shutil.copyfile(folder / f"{DATABASE}{suffix}", copy / f"{DATABASE}{suffix}")
        if not (copy / DATABASE).is_file():
            return {}, 0, 0
        with closing(sqlite3.connect(copy / DATABASE)) as connection:
            corrupt = connection.execute("PRAGMA integrity_check").fetchall() != [("ok",)]
            if not connection.execute(
                "SELECT name FROM sqlite_schema WHERE name = 'result'"
            ).fetchall():
                return {}, 0, int(corrupt)
            found = connection.execute(
                "SELECT key, result, start FROM result WHERE kind = 'image'"
            ).fetchall()
        measurements = [_measurement(result) for _, result, _ in found]
        known = [measurement for measurement in measurements if measurement]
        return (
            {key: finished for key, _, finished in found},
            len(known) - len(set(known)),
            int(corrupt) + len(measurements) - len(known),
        )


def _measurement(result: str) -> tuple:
    """What a row is about; nothing where it is damaged."""
    try:
        row = json.loads(result)
        return tuple(row[name] for name in ("scene", "environment", "sampler", "budget", "seed"))
    except (ValueError, KeyError):
        return ()


def _changes(before: dict[str, float], after: dict[str, float]) -> tuple[int, int]:
    """How many finished measurements are gone, and how many were measured again."""
    lost = before.keys() - after.keys()
    again = sum(after[key] != before[key] for key in before.keys() & after.keys())
    return len(lost), again


def _ended(child: int) -> bool:
    return os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT) is not None


def _left_over(group: int) -> int:
    """How many processes of a group are still there GONE_SECONDS after its first has ended."""
    until = time.monotonic() + GONE_SECONDS
    while (found := list(_living_groups()).count(group)) and (time.monotonic() < until):
        time.sleep(0.05)
    return found


def _living_groups() -> Iterator[int]:
    """The group of each process of this machine that has not ended."""
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # it ended meanwhile
            state, _, group = status.read_text().rpartition(")")[2].split()[:3]
            if state != "Z":
                yield int(group)


def _is_told(status: int, kill: signal.Signals, errors: str) -> bool:
    """A killed process says nothing but its last words, an interrupted one a single sentence.

    Python ends itself by the signal, after all else, where an interrupt came while code from a
    string ran; for a shell that is status 130 as well."""
    lines = [line for line in errors.splitlines() if not PROGRESS.fullmatch(line)]
    if kill == signal.SIGKILL:
        return status == -kill and not lines
    one_line = len(lines) == 1 and lines[0].startswith("envlight: interrupted")
    return status in (INTERRUPTED, -kill) and one_line


def _files(folder: Path) -> dict[str, bytes]:
    """The files of a run that have their final names, by path."""
    found = (file for file in folder.rglob("*") if file.is_file())
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in found
        if not file.name.startswith(".") and not file.name.endswith(("-wal", "-shm"))
    }


def _is_image(name: str) -> bool:
    """Whether a file is a rendered image, or a montage; plots show times, which differ."""
    return name.endswith(".exr") or "montages/" in name


def _untimed(path: Path) -> str:
    """A table without its timed columns, as text."""
    table = pd.read_csv(path, dtype=str)
    return table.drop(columns=[name for name in TIMED if name in table]).to_csv()


def run_campaign(
    place: Path, executors: Sequence[str], runs: int, seed: int, told: Callable[[Kill | End], None]
) -> None:
    """Kill `runs` runs by each executor in the new folder `place`; each kill and end is told."""
    import OpenImageIO

    OpenImageIO.attribute("threads", 1)
    for executor in executors:
        campaign = Campaign(place / executor, executor, seed, told)
        for number in range(runs):
            campaign.one_run(number)
