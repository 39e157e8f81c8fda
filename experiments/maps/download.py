"""Download of one file whose size and MD5 are known: verified, resumed, retried, atomic.

Bytes go to NAME.part beside the target, unbuffered, so that whatever ends the process leaves all
that has come; the next start asks for the rest. Only a file of the right size and MD5 gets its
final name. MD5 finds damage, not malice: it is what the server lists.
"""

import hashlib
import os
import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import requests
import urllib3

from samplers import EnvlightError

T = TypeVar("T")
CHUNK = 1 << 16
AGAIN = frozenset({408, 425, 429, 500, 502, 503, 504})
"""Statuses of troubles that pass."""
LONGEST_WAIT = 60.0


@dataclass(frozen=True)
class RemoteFile:
    """What a server offers: `size` in bytes, `md5` in hexadecimal."""

    url: str
    size: int
    md5: str


@dataclass(frozen=True)
class Patience:
    """When to give up.

    attempts : tries in a row that bring nothing new
    backoff : seconds before the second try; doubled before each later one
    timeout : seconds without an answer or a byte that end a try
    """

    attempts: int = 5
    backoff: float = 1.0
    timeout: float = 30.0

    def wait(self, failures: int, response: requests.Response | None) -> None:
        """Sleep before the next try; longer where the server asks for it."""
        asked = response.headers.get("Retry-After", "") if response is not None else ""
        seconds = max(self.backoff * 2.0 ** (failures - 1), float(asked) if asked.isdigit() else 0)
        time.sleep(min(seconds, LONGEST_WAIT))


class PassingTrouble(Exception):
    """One try failed; another may not."""

    def __init__(self, reason: str, response: requests.Response | None = None) -> None:
        super().__init__(reason)
        self.response = response


def get(session: requests.Session, url: str, timeout: float, start: int = 0) -> requests.Response:
    """An answer of status 200, 206, 400, 404 or 416, its body unread; from byte `start` on.

    Raises PassingTrouble for what may pass, EnvlightError for what will not.
    """
    headers = {"Accept-Encoding": "identity"} | ({"Range": f"bytes={start}-"} if start else {})
    try:
        response = session.get(url, headers=headers, stream=True, timeout=timeout)
    except (requests.ConnectionError, requests.Timeout) as error:
        raise PassingTrouble(reason(error)) from error
    except (requests.RequestException, ValueError) as error:
        raise EnvlightError(f"{url}: {reason(error)}; check the address") from error
    if response.status_code in AGAIN:
        response.close()
        raise PassingTrouble(f"status {response.status_code}", response)
    if response.status_code not in (200, 206, 400, 404, 416):
        response.close()
        raise EnvlightError(f"{url}: the server answers with status {response.status_code}")
    return response


def reason(error: Exception) -> str:
    """Why a request failed, in a few words."""
    if isinstance(error, requests.Timeout) or "timed out" in str(error):
        return "no answer in time"
    if isinstance(error, requests.TooManyRedirects):
        return "it is redirected without end"
    if isinstance(error, requests.exceptions.SSLError):
        return "no trusted connection"
    if isinstance(error, requests.exceptions.ChunkedEncodingError | urllib3.exceptions.HTTPError):
        return "the connection was cut"
    if isinstance(error, requests.ConnectionError):
        return "no connection"
    return "no address that can be asked"


def patiently(
    url: str, patience: Patience, attempt: Callable[[], T], reached: Callable[[], int] = int
) -> T:
    """What `attempt` returns, tried again after troubles that may pass.

    reached : how far the tries have come; going further starts the count of failures anew

    Raises EnvlightError when patience ends.
    """
    failures, furthest = 0, reached()
    while True:
        try:
            return attempt()
        except PassingTrouble as trouble:
            failures = 1 if reached() > furthest else failures + 1
            furthest = max(furthest, reached())
            if failures >= patience.attempts:
                raise EnvlightError(
                    f"{url}: {trouble} ({failures} attempts in a row); try later, the same "
                    "command goes on with what is missing"
                ) from trouble
            patience.wait(failures, trouble.response)


def is_whole(path: Path, remote: RemoteFile) -> bool:
    """Whether the file is there with the right size and MD5."""
    if not path.is_file() or path.stat().st_size != remote.size:
        return False
    with path.open("rb") as file:
        return hashlib.file_digest(file, "md5").hexdigest() == remote.md5


def download(
    session: requests.Session,
    remote: RemoteFile,
    target: Path,
    patience: Patience,
    advance: Callable[[int], None] = lambda count: None,
) -> None:
    """Bring the file to `target`. One process at a time may do this for a target.

    advance : told the number of bytes that are there now, as it grows

    Raises EnvlightError where it cannot be had whole or written; what has come is kept.
    """
    part = target.with_name(f"{target.name}.part")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        missing = remote.size - (part.stat().st_size if part.exists() else 0)
        if missing > (free := shutil.disk_usage(target.parent).free):
            raise EnvlightError(
                f"{target}: {missing / 1e9:.1f} GB are to come and {free / 1e9:.1f} GB are free; "
                "make room, or give another folder by --to"
            )
        patiently(
            remote.url,
            patience,
            lambda: _attempt(session, remote, part, patience.timeout, advance),
            lambda: part.stat().st_size if part.exists() else 0,
        )
        part.replace(target)
    except OSError as error:
        raise EnvlightError(
            f"{target}: cannot be written ({error.strerror}); make room, or give another folder "
            "by --to"
        ) from error


def _attempt(
    session: requests.Session,
    remote: RemoteFile,
    part: Path,
    timeout: float,
    advance: Callable[[int], None],
) -> None:
    """Complete the partial file; PassingTrouble where it is cut short or comes out wrong."""
    there = part.stat().st_size if part.exists() else 0
    if there < remote.size:
        _receive(session, remote, part, there, timeout, advance)
    if is_whole(part, remote):
        return
    size = part.stat().st_size
    if size < remote.size:
        raise PassingTrouble(f"only {size} of {remote.size} bytes came")
    part.unlink()
    wrong = f"{size} bytes" if size != remote.size else "the MD5"
    raise PassingTrouble(f"{wrong} instead of the {remote.size} bytes of MD5 {remote.md5} listed")


def _receive(
    session: requests.Session,
    remote: RemoteFile,
    part: Path,
    there: int,
    timeout: float,
    advance: Callable[[int], None],
) -> None:
    """Append what is missing, or begin anew where the server gives the whole only."""
    with get(session, remote.url, timeout, there) as response:
        if response.status_code == 416:
            part.unlink()
            raise PassingTrouble("the server cannot go on where it was")
        if response.status_code in (400, 404):
            raise EnvlightError(f"{remote.url}: not there, though listed; try later")
        goes_on = response.status_code == 206 and _begins_at(response, there)
        if response.status_code == 206 and not goes_on:
            part.unlink(missing_ok=True)
            raise PassingTrouble("the server sent another part than asked for")
        with part.open("ab" if goes_on else "wb", buffering=0) as file:
            size = there if goes_on else 0
            advance(size)
            try:
                # What has come is taken at once: a full read would lose it to a cut.
                while chunk := response.raw.read1(CHUNK):
                    file.write(chunk)
                    size += len(chunk)
                    advance(size)
                    if size > remote.size:
                        break
            except urllib3.exceptions.HTTPError as error:
                raise PassingTrouble(reason(error)) from error
            os.fsync(file.fileno())


def _begins_at(response: requests.Response, start: int) -> bool:
    return response.headers.get("Content-Range", "").startswith(f"bytes {start}-")


class Transfer:
    """How far a transfer is; says nothing."""

    def working_on(self, what: str) -> None: ...
    def reached(self, count: int) -> None: ...


@contextmanager
def transfer_progress(what: str, total: int, in_bytes: bool = False) -> Iterator[Transfer]:
    """A progress bar over `total` steps or bytes where stderr is a terminal, nothing otherwise."""
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        DownloadColumn,
        MofNCompleteColumn,
        TextColumn,
        TimeRemainingColumn,
        TransferSpeedColumn,
    )
    from rich.progress import Progress as Bar

    console = Console(stderr=True)
    if not console.is_terminal or not total:
        yield Transfer()
        return
    counts = (DownloadColumn(), TransferSpeedColumn()) if in_bytes else (MofNCompleteColumn(),)
    columns = (TextColumn("{task.description}"), BarColumn(), *counts, TimeRemainingColumn())
    with Bar(*columns, console=console) as bar:
        yield _TerminalTransfer(bar, bar.add_task(what, total=total))


class _TerminalTransfer(Transfer):
    def __init__(self, bar, task) -> None:
        self._bar, self._task = bar, task

    def working_on(self, what: str) -> None:
        self._bar.update(self._task, description=what)

    def reached(self, count: int) -> None:
        self._bar.update(self._task, completed=count)
