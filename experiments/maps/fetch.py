"""What `envlight fetch` does: maps of Poly Haven, or of a mirror, into the maps' folder.

For each map the server lists, per resolution and format, address, size and MD5
(https://api.polyhaven.com/files/ID). Files that are whole are left alone. Bytes go to NAME.part
beside the target, unbuffered, so that whatever ends the process leaves all that has come; the next
start asks for the rest. (The library pooch has no such thing: it begins a file of 500 MB anew.)
Only a file of the right size and MD5 gets its final name; MD5 finds damage, not malice.
"""

import hashlib
import importlib.metadata
import json
import os
import re
import shutil
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import requests
import urllib3

from experiments.maps.poly_haven import RESOLUTIONS, SUITES, maps_folder
from experiments.progress import Told, telling
from samplers import EnvlightError

T = TypeVar("T")
API = "https://api.polyhaven.com"
FORMATS = ("exr", "hdr")
LOCK = ".fetch.lock"
MEGABYTE = 1e6
LARGEST_LISTING = 1 << 22
"""Bytes; that of a map has a hundredth. What is decoded takes up to thirty times as much memory."""
_MD5 = re.compile(r"[0-9a-f]{32}")
_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
CHUNK = 1 << 16
AGAIN = frozenset({408, 425, 429, 500, 502, 503, 504})
"""Statuses of troubles that pass."""
LONGEST_WAIT = 60.0
REASONS = (
    (requests.TooManyRedirects, "it is redirected without end"),
    (requests.exceptions.SSLError, "no trusted connection"),
    (requests.exceptions.ChunkedEncodingError, "the connection was cut"),
    (urllib3.exceptions.HTTPError, "the connection was cut"),
    (requests.ConnectionError, "no connection"),
)
"""Why a request failed; the first that fits."""


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


@dataclass(frozen=True)
class FetchRequest:
    """The options of `envlight fetch`.

    names : suites and ids of maps
    folder : where to; None for the maps' folder
    """

    names: list[str]
    resolution: str = "1k"
    format: str = "exr"
    folder: Path | None = None
    api: str = API
    patience: Patience = field(default_factory=Patience)

    def ids(self) -> list[str]:
        """The maps that are meant; EnvlightError for what cannot be one."""
        for text, known in ((self.resolution, RESOLUTIONS), (self.format, FORMATS)):
            if text not in known:
                raise EnvlightError(f"fetch: there is no '{text}'; write {', '.join(known)}")
        for name in self.names:
            if name not in SUITES and not _ID.fullmatch(name):
                raise EnvlightError(
                    f"fetch: '{name}' is no map's id; it is the last word of the map's address "
                    f"at polyhaven.com, or one of {', '.join(SUITES)}"
                )
        return list(dict.fromkeys(key for name in self.names for key in SUITES.get(name, (name,))))


def fetch(request: FetchRequest) -> None:
    """Download what is not there yet, and say what was done."""
    ids, folder = request.ids(), request.folder or maps_folder()
    with _alone_in(folder), _session() as session:
        with telling("looking up", len(ids)) as told:
            # All before any download, so that a wrong id ends it at once.
            remotes = {}
            for name in ids:
                remotes[name] = _look_up(session, request, name)
                told.advance()
        targets = {name: folder / f"{name}_{request.resolution}.{request.format}" for name in ids}
        todo = [name for name in ids if not is_whole(targets[name], remotes[name])]
        for name in todo:
            if targets[name].exists():
                print(f"{targets[name]}: not the file that is offered; it is replaced")
        finished, total = 0, sum(remotes[name].size for name in todo)
        with telling("downloading", total, in_bytes=True) as told:
            for name in todo:
                told.working_on(targets[name].name)
                _Download(session, remotes[name], targets[name], told, finished).run(
                    request.patience
                )
                finished += remotes[name].size
    print(
        f"{len(todo)} maps downloaded ({total / MEGABYTE:.1f} MB), "
        f"{len(ids) - len(todo)} were there already: {folder}"
    )


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """The folder, made where it is missing, for this process alone until the block ends.

    The lock is SQLite's on an empty file; the operating system lets go of it however we end.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = sqlite3.connect(folder / LOCK, timeout=0.0)
        lock.execute("BEGIN EXCLUSIVE")
    except OSError as error:
        raise EnvlightError(
            f"{folder}: cannot be written ({error.strerror}); give another folder by --to"
        ) from error
    except sqlite3.Error as error:
        raise EnvlightError(
            f"{folder}: in use by another fetch, or not writable ({error}); wait for it, or give "
            "another folder by --to"
        ) from error
    with closing(lock):
        yield


@contextmanager
def _session() -> Iterator[requests.Session]:
    with requests.Session() as session:
        session.headers["User-Agent"] = f"envlight/{importlib.metadata.version('envlight')}"
        yield session


def _look_up(session: requests.Session, request: FetchRequest, name: str) -> RemoteFile:
    """What the server offers of a map at the wanted resolution and format."""
    url = f"{request.api.rstrip('/')}/files/{name}"
    listing = patiently(
        url, request.patience, lambda: _listing(session, url, request.patience.timeout)
    )
    if listing is None:
        raise EnvlightError(
            f"fetch: Poly Haven has no map called '{name}'; the id is the last word of the map's "
            "address at polyhaven.com"
        )
    sizes = listing.get("hdri") if isinstance(listing, dict) else None
    if not isinstance(sizes, dict):
        raise EnvlightError(f"fetch: '{name}' is no environment map at Poly Haven")
    offered = sizes.get(request.resolution)
    entry = offered.get(request.format) if isinstance(offered, dict) else None
    if not isinstance(entry, dict):
        raise EnvlightError(
            f"fetch: '{name}' is not there as {request.resolution} .{request.format}; there are "
            f"{', '.join(sorted(sizes, key=lambda key: (len(key), key)))}"
        )
    address, size, md5 = entry.get("url"), entry.get("size"), str(entry.get("md5")).lower()
    if not (address and isinstance(size, int) and size > 0 and _MD5.fullmatch(md5)):
        raise EnvlightError(
            f"{url}: no address, size and MD5 of the map; check the address given by --api"
        )
    return RemoteFile(str(address), size, md5)


def _listing(session: requests.Session, url: str, timeout: float) -> Any:
    """The decoded answer, None where the server knows no such map."""
    with get(session, url, timeout) as response:
        if response.status_code in (400, 404):
            return None
        try:
            body = response.raw.read(LARGEST_LISTING + 1, decode_content=True)
        except urllib3.exceptions.HTTPError as error:
            raise PassingTrouble(reason(error)) from error
    if len(body) > LARGEST_LISTING:
        raise EnvlightError(
            f"{url}: the answer is longer than the {LARGEST_LISTING:,} bytes that a list of files "
            "may have; check the address given by --api"
        )
    try:
        return json.loads(body)
    except (ValueError, RecursionError) as error:
        raise EnvlightError(
            f"{url}: the answer is no list of files; check the address given by --api"
        ) from error


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
    found = (words for kinds, words in REASONS if isinstance(error, kinds))
    return next(found, "no address that can be asked")


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


@dataclass(frozen=True)
class _Download:
    """A file on its way to `target`; one process at a time may do this for a target.

    told : how far all downloads are; before : bytes of those that are there
    """

    session: requests.Session
    remote: RemoteFile
    target: Path
    told: Told
    before: int

    @property
    def part(self) -> Path:
        return self.target.with_name(f"{self.target.name}.part")

    def come(self) -> int:
        """How many bytes are there."""
        return self.part.stat().st_size if self.part.exists() else 0

    def run(self, patience: Patience) -> None:
        """Bring the file; EnvlightError where it cannot be had whole or written."""
        target, part = self.target, self.part
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            missing = self.remote.size - self.come()
            if missing > (free := shutil.disk_usage(target.parent).free):
                raise EnvlightError(
                    f"{target}: {missing / 1e9:.1f} GB are to come and {free / 1e9:.1f} GB are "
                    "free; make room, or give another folder by --to"
                )
            url = self.remote.url
            patiently(url, patience, lambda: self._attempt(patience.timeout), self.come)
            part.replace(target)
        except OSError as error:
            raise EnvlightError(
                f"{target}: cannot be written ({error.strerror}); make room, or give another "
                "folder by --to"
            ) from error

    def _attempt(self, timeout: float) -> None:
        """Complete the partial file; PassingTrouble where it is cut short or comes out wrong."""
        remote = self.remote
        if self.come() < remote.size:
            self._receive(timeout)
        if is_whole(self.part, remote):
            return
        size = self.come()
        if size < remote.size:
            raise PassingTrouble(f"only {size} of {remote.size} bytes came")
        self.part.unlink()
        wrong = f"{size} bytes" if size != remote.size else "the MD5"
        raise PassingTrouble(
            f"{wrong} instead of the {remote.size} bytes of MD5 {remote.md5} listed"
        )

    def _receive(self, timeout: float) -> None:
        """Append what is missing, or begin anew where the server gives the whole only."""
        size = self.come()
        with get(self.session, self.remote.url, timeout, size) as response:
            status = response.status_code
            if status in (400, 404):
                raise EnvlightError(f"{self.remote.url}: not there, though listed; try later")
            begins = response.headers.get("Content-Range", "").startswith(f"bytes {size}-")
            if status == 416 or (status == 206 and not begins):
                self.part.unlink(missing_ok=True)
                raise PassingTrouble("the server did not go on where it was")
            if status != 206:
                size = 0
            with self.part.open("ab" if size else "wb", buffering=0) as file:
                try:
                    # What has come is taken at once: a full read would lose it to a cut.
                    while size <= self.remote.size and (chunk := response.raw.read1(CHUNK)):
                        file.write(chunk)
                        size += len(chunk)
                        self.told.done = self.before + size
                except urllib3.exceptions.HTTPError as error:
                    raise PassingTrouble(reason(error)) from error
                os.fsync(file.fileno())
