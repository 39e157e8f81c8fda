"""What `envlight fetch` does: maps of Poly Haven, or of a mirror, into the maps' folder.

For each map the server lists, per resolution and format, address, size and MD5
(https://api.polyhaven.com/files/ID). Files that are whole are left alone.
"""

import importlib.metadata
import json
import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import requests
import urllib3

from experiments.maps.download import (
    PassingTrouble,
    Patience,
    RemoteFile,
    Transfer,
    download,
    get,
    is_whole,
    patiently,
    reason,
    transfer_progress,
)
from experiments.maps.poly_haven import RESOLUTIONS, SUITES, maps_folder
from samplers import EnvlightError

API = "https://api.polyhaven.com"
FORMATS = ("exr", "hdr")
LOCK = ".fetch.lock"
MEGABYTE = 1e6
LARGEST_LISTING = 1 << 22
"""Bytes; that of a map has a hundredth. What is decoded takes up to thirty times as much memory."""
_MD5 = re.compile(r"[0-9a-f]{32}")
_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")


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
        with transfer_progress("looking up", len(ids)) as progress:
            # All before any download, so that a wrong id ends it at once.
            remotes = {}
            for name in ids:
                remotes[name] = _look_up(session, request, name)
                progress.reached(len(remotes))
        targets = {name: folder / f"{name}_{request.resolution}.{request.format}" for name in ids}
        todo = [name for name in ids if not is_whole(targets[name], remotes[name])]
        for name in todo:
            if targets[name].exists():
                print(f"{targets[name]}: not the file that is offered; it is replaced")
        finished, total = 0, sum(remotes[name].size for name in todo)
        with transfer_progress("downloading", total, in_bytes=True) as progress:
            for name in todo:
                progress.working_on(targets[name].name)
                advance = partial(_advance, progress, finished)
                download(session, remotes[name], targets[name], request.patience, advance)
                finished += remotes[name].size
    print(
        f"{len(todo)} maps downloaded ({total / MEGABYTE:.1f} MB), "
        f"{len(ids) - len(todo)} were there already: {folder}"
    )


def _advance(progress: Transfer, before: int, count: int) -> None:
    progress.reached(before + count)


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
