"""Where commands may write: never over what they read, nor over what something else wrote.

A file appears whole by `renderer.image.write_whole`, a folder by `renewed_folder`: either is made
beside its place and moved there, so that a stop leaves the old or the new; where it comes between
the two moves of a folder, the next command brings the old one back. Of what a folder holds, only
the files that a record or a mark lists as written here are ever removed.
"""

import os
import re
import shutil
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from samplers.errors import EnvlightError

HEAD = 1 << 16
"""Bytes of a file in which its kind is looked for."""


@dataclass(frozen=True)
class Kind:
    """What a command writes. name : as a sentence says it; signs : one of them is in its head"""

    name: str
    signs: tuple[bytes, ...]


EXR = Kind("an OpenEXR image", (b"\x76\x2f\x31\x01",))
HDR = Kind("a Radiance picture", (b"#?RADIANCE",))
PNG = Kind("a PNG picture", (b"\x89PNG\r\n\x1a\n",))


def check_output(
    output: Path, kind: Kind, option: str = "--output", reads: Iterable[Path | str] = ()
) -> None:
    """EnvlightError where a file must not or could not be written, said before the work is done.

    Over a file that is there, only the same kind is written, and never over one that is read.

    reads : files that the command reads; names of something else do no harm
    """
    check_name(output, option)
    folder = output.parent
    existing = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise EnvlightError(f"{option} {output}: {existing} cannot be written; give another place")
    if any(same_file(output, Path(read)) for read in reads):
        raise EnvlightError(
            f"{option} {output}: this command reads that file; give another file's name"
        )
    if output.exists() and not _is(output, kind):
        raise EnvlightError(
            f"{option} {output}: the file there is not {kind.name} as this command writes it; give "
            "another name, or remove that file"
        )
    if (place := os.path.realpath(folder)) == "/dev" or place.startswith("/proc/"):
        raise EnvlightError(f"{option} {output}: among devices no file is made; give another place")


def check_name(output: Path, option: str = "--output") -> None:
    """EnvlightError where a path names no file."""
    if not output.name or output.is_dir():
        raise EnvlightError(f"{option} {output}: it names a folder; give a file's name")


def _is(file: Path, kind: Kind) -> bool:
    """Whether an existing file is of a kind, or empty."""
    if not file.is_file():  # a device or a pipe
        return False
    with file.open("rb") as opened:
        head = opened.read(HEAD)
    return not head or any(sign in head for sign in kind.signs)


def same_file(one: Path, other: Path) -> bool:
    """Whether two paths lead to one file, or would; names that differ in case alone may."""
    with suppress(OSError, ValueError, RuntimeError):  # no such file; no path; links in a ring
        one, other = one.resolve(), other.resolve()  # a folder that is not there yet may lead back
        if one.exists() or other.exists():
            return one.exists() and other.exists() and one.samefile(other)
        return str(one).casefold() == str(other).casefold()
    return False


def check_apart(target: Path, reads: Iterable[Path]) -> None:
    """EnvlightError where a folder that is to be replaced is, or holds, one that is read."""
    for read in reads:
        if any(same_file(target, place) for place in (read, *read.resolve().parents)):
            raise EnvlightError(
                f"{target}: {read}, which this command reads, is there; give another folder"
            )


@contextmanager
def renewed_folder(target: Path, own: Collection[str] | None = None) -> Iterator[Path]:
    """An empty folder, called as `target`, that takes its place at once when the block ends well.

    own : files of the old folder, by relative path, that go with it; others come along, unless the
        new one has files of their names. None for all.

    Nothing changes where the block raises. EnvlightError where the place cannot be written.
    """
    place = target.resolve()
    if place.exists() and not place.is_dir():
        raise EnvlightError(f"{target}: it is a file; give a folder")
    beside = place.with_name(f".{place.name}.{os.getpid()}")
    new = beside / "new" / place.name
    try:
        _remove_leftovers(place)
        new.mkdir(parents=True)
        yield new
        if own is not None and place.is_dir():
            _bring_others(place, new, set(own))
        _put(new, place, beside / "old")
    except OSError as error:
        raise EnvlightError(
            f"{target}: the folder cannot be written ({error}); check its permissions and the "
            "space left, or give another one"
        ) from error
    finally:
        if place.exists() or not (beside / "old").exists():
            shutil.rmtree(beside, ignore_errors=True)


def _bring_others(old: Path, new: Path, own: Collection[str]) -> None:
    """Put the files of the old folder that are not its own into the new one, too."""
    for file in old.rglob("*"):
        inside = file.relative_to(old)
        there = new / inside
        if (file.is_dir() and not file.is_symlink()) or inside.as_posix() in own:
            continue
        if not os.path.lexists(there):
            there.parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(file, there, follow_symlinks=False)
            except OSError:
                shutil.copy2(file, there, follow_symlinks=False)


def _put(new: Path, place: Path, old: Path) -> None:
    """Move a folder to its place, and away what is there; `_remove_leftovers` undoes half of it."""
    if place.exists():
        place.rename(old)
    try:
        new.rename(place)
    except OSError:
        if old.exists():
            old.rename(place)
        raise


def _remove_leftovers(place: Path) -> None:
    """Remove what killed processes began beside a folder; what one had moved away comes back."""
    for beside in place.parent.glob(".*"):
        found = re.fullmatch(rf"\.{re.escape(place.name)}\.(\d+)", beside.name)
        if found is None or process_lives(int(found[1])):
            continue
        if not place.exists() and (beside / "old").is_dir():
            (beside / "old").rename(place)
        shutil.rmtree(beside, ignore_errors=True)


def process_lives(process: int) -> bool:
    """Whether another process of a number is there; where none can be asked for, it is."""
    if os.name != "posix" or process == os.getpid():
        return os.name != "posix"
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True


def mark(folder: Path, name: str, sentence: str) -> None:
    """Write the file that lists all others of a folder as made here, below a sentence."""
    files = sorted(
        file.relative_to(folder).as_posix() for file in folder.rglob("*") if file.is_file()
    )
    (folder / name).write_text("\n".join([sentence, *files, ""]), encoding="utf-8")


def marked(folder: Path, name: str) -> list[str] | None:
    """The files that a mark lists, and itself; None where it lists none, as older ones do."""
    lines = (folder / name).read_text("utf-8", "replace").splitlines()[1:]
    return [name, *lines] if lines else None


def remove_listed(folder: Path, names: Iterable[str]) -> None:
    """Remove files that a list names, of those inside the folder; a list can say anything."""
    root = folder.resolve()
    for name in names:
        file = folder / name
        if file.parent.resolve().is_relative_to(root) and (file.is_file() or file.is_symlink()):
            file.unlink()
