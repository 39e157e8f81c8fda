"""Which files the samplers of somebody else read: they determine results as source code does.

A file counts that a plug-in's source names, by its path from there, or that was opened for it while
it was loaded. What it would open later, when its results have their key already, is refused. Python
tells of each file that is opened; machine code of other libraries does not, so a file that only
such a library reads counts where it is named.
"""

import ast
import linecache
import os
import re
import sys
import threading
import traceback
from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

from samplers import kernel_cache
from samplers.errors import EnvlightError, told

ROOT = Path(__file__).resolve().parents[2]
LOADING = {
    (str(ROOT / "samplers" / "files" / "from_file.py"), "_module"),
    (str(ROOT / "samplers" / "registry.py"), "_load_all"),
}
READERS = linecache.__file__, kernel_cache.__file__
"""What reads source, and kept machine code, for whoever calls it."""
WORKING = tuple(f"{ROOT / name}{os.sep}" for name in ("experiments", "renderer"))
"""Code that loads plug-ins, and code that calls them."""
ELSEWHERE = ("/proc/", "/sys/", "/dev/", f"{Path(os.__file__).parent}{os.sep}", *WORKING,
             f"{ROOT / 'samplers'}{os.sep}", f"{ROOT / 'metrics'}{os.sep}")  # fmt: skip
NOT_OWN = {"site-packages", "dist-packages", "__pycache__"}
EVENTS = ("open", "ctypes.dlopen", "sqlite3.connect")
ENDING = re.compile(r"_*[eE]xit|quick_exit|abort|f?exec[lv]\w*")
"""Functions of C's that end a program, or put another in its place."""
_PROCESS, _exit = os.getpid(), os._exit
_folders: list[Path] = []
_read: dict[str, set[Path]] = defaultdict(set)
"""What was opened while plug-ins were loaded, by the file whose code wanted it."""


def watch(folder: Path) -> None:
    """Have all files in a folder count as those of plug-ins."""
    if not _folders:
        sys.addaudithook(_note)
        os._exit, threading.excepthook = _end, _tell
    if folder not in _folders:
        _folders.append(folder)
        is_plug_in.cache_clear()


@cache
def is_plug_in(file: str) -> bool:
    """Whether a source file is a plug-in's own."""
    path = Path(file)
    return not file.startswith(ELSEWHERE) and any(
        path.is_relative_to(folder) and not NOT_OWN & set(path.relative_to(folder).parts)
        for folder in _folders
    )


def line_of(error: BaseException) -> str:
    """The innermost line of a plug-in that an error went through, "" where there is none."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [f"{one.filename}: line {one.lineno}" for one in frames if is_plug_in(one.filename)]
    return lines[-1] if lines else ""


def _tell(end: threading.ExceptHookArgs) -> None:
    """Say in a sentence that a plug-in's thread has failed, which nobody waits for."""
    line = line_of(end.exc_value) if end.exc_value else ""
    if line and end.exc_value:
        print(f"envlight: {line}: its thread ended by {told(end.exc_value)}", file=sys.stderr)
    else:
        threading.__excepthook__(end)


def data_files(source: Path) -> dict[str, Path]:
    """The files that count with a plug-in's source file, by their paths from its folder."""
    if not is_plug_in(str(source)):
        return {}
    found = {*_named(source), *_read[str(source)]}
    return {Path(os.path.relpath(path, source.parent)).as_posix(): path for path in sorted(found)}


@cache
def _named(source: Path) -> frozenset[Path]:
    """What is there under a path that a source file holds as a string."""
    texts = [node.value for node in ast.walk(ast.parse(source.read_bytes()))
             if isinstance(node, ast.Constant) and isinstance(node.value, str)]  # fmt: skip
    return frozenset(_present(source.parent, texts))


def _present(folder: Path, texts: list[str]) -> Iterator[Path]:
    for text in texts:
        if 0 < len(text) < 256 and text.isprintable() and (folder / text).is_file():
            yield (folder / text).resolve()


def _note(event: str, arguments: tuple[Any, ...]) -> None:
    """What Python calls at each event: notes a file that is read, or refuses to have it opened."""
    if event == "os.exec":
        _refuse_end(f"os.exec of {arguments[0]}")
    elif event == "ctypes.dlsym" and ENDING.fullmatch(str(arguments[1])):
        _refuse_end(f"C's {arguments[1]}")
    if event not in EVENTS or not isinstance(arguments[0], str | bytes | os.PathLike):
        return
    if event == "open" and _writes(arguments[1], arguments[2]):
        return
    asking, loading = _asking(sys._getframe(1))
    if not asking:
        return
    path = Path(os.fsdecode(arguments[0])).resolve()
    if not _counts(path):
        return
    if loading:
        _read[asking].add(path)
    elif path not in data_files(Path(asking)).values():
        raise EnvlightError(
            f"{asking}: it opens {path}, which is not among what its results are known to depend "
            "on; read it where the file is loaded, outside of functions, or name its whole path in "
            "a string"
        )


def _end(status: int) -> NoReturn:
    """What `os._exit` is where plug-ins are loaded; it stays, as they may call it at any time."""
    _refuse_end(f"os._exit({status})")
    _exit(status)


def _refuse_end(by: str) -> None:
    """Raise where a plug-in ends this process; a copy that it made of it may end."""
    if os.getpid() == _PROCESS and _asking(sys._getframe(2))[0]:
        raise EnvlightError(f"it ends the program, by {by}; let it raise an error")


def _writes(mode: str | None, flags: int) -> bool:
    if mode is not None:
        return not mode.startswith("r") or "+" in mode
    return flags & (os.O_WRONLY | os.O_RDWR) != 0


def _asking(frame: FrameType | None) -> tuple[str, bool]:
    """The plug-in's file whose code opens something, and whether that is while it is loaded.

    Empty where no plug-in does: where a library does while it is imported, a program of the user's
    own, the project, or what shows a line of source in a message or keeps compiled kernels.
    """
    asking = ""
    while frame is not None:
        file = frame.f_code.co_filename
        if (file, frame.f_code.co_name) in LOADING:
            return asking, True
        if file == __file__ or file.startswith(WORKING):
            return asking, False
        if not asking and (file.startswith("<frozen importlib") or file in READERS):
            break
        if not asking and is_plug_in(file):
            asking = file
        frame = frame.f_back
    return "", False


def _counts(path: Path) -> bool:
    """Whether a file is neither the system's nor of what is installed, which count otherwise."""
    if is_plug_in(str(path)):
        return path.is_file()
    return path.is_file() and not str(path).startswith(ELSEWHERE) and not NOT_OWN & set(path.parts)
