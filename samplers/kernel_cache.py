"""Where compiled kernels are kept between starts, under a name that tells all they depend on.

Numba decides by a function's own file whether kept machine code is still good, although the code
holds functions and constants of other files; and it trusts what it reads. Here, for every function
that Numba keeps, also for those in files of a user's own, a kernel's name is a hash of its program
and of all that the program names, directly or not: functions, with the files they stand in, and
constants. What is kept stands behind a hash of itself, so that what was damaged is compiled anew.
"""

import contextlib
import enum
import hashlib
import os
import pickle
import platform
import re
import sys
import threading
import time
import types
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, TypeGuard

import llvmlite
import numba
import numpy as np
import platformdirs
from numba.core import caching, config
from numba.core.dispatcher import Dispatcher
from numba.core.serialize import dumps
from numba.core.typing.templates import builtin_registry

SUFFIX = ".kernel"
MOST_BYTES = 1 << 30
"""What is kept at most; what was not used for longest goes first."""
CHECKSUM_BYTES = 16
_STARTED = time.time()
_VERSIONS = [platform.python_version(), numba.__version__, llvmlite.__version__, np.__version__]
_SWITCHES = "OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "DEBUGINFO_DEFAULT"
"""Of Numba's settings those that change machine code and are named nowhere else."""
_INSTALLED = re.compile(r"[\\/](site|dist)-packages[\\/]|<frozen ")
_STANDARD = str(Path(os.__file__).parent)


class Unknown(Exception):
    """A kernel names something of which nobody knows what it makes of the machine code."""


def places() -> list[Path]:
    """Folders for kernels, the one to be preferred first."""
    given = os.environ.get("NUMBA_CACHE_DIR")
    home = Path(given) if given else platformdirs.user_cache_path("envlight")
    return [home / "kernels", Path(__file__).resolve().parent / "__pycache__" / "kernels"]


@cache
def folder() -> Path | None:
    """The folder where kernels are kept, None where none can be written, which is told."""
    for place in places():
        with contextlib.suppress(OSError):
            place.mkdir(parents=True, exist_ok=True)
            if os.access(place, os.W_OK):
                return place
    _tell(f"{places()[0]}: kernels cannot be kept there; set NUMBA_CACHE_DIR to another folder")
    return None


@cache
def _tell(sentence: str) -> None:
    """Say something once."""
    print(f"envlight: {sentence}", file=sys.stderr)


def dependencies(function: types.FunctionType) -> str:
    """A hash of all that a function's machine code depends on; `Unknown` where that is not known.

    What it names is followed in a fixed order, and each thing referred to by its place in it.
    """
    met: list[Any] = [function]
    places = {id(function): 0}
    texts = [_text_of_function(function, followed=True)]
    hasher = hashlib.blake2b(digest_size=CHECKSUM_BYTES)
    for text, needed in texts:  # grows meanwhile
        hasher.update(text.encode())
        for value in needed:
            simple = _text_of_value(value)
            if simple is None and id(value) not in places:
                places[id(value)] = len(met)
                met.append(value)
                text_of, needs = _text_of_thing(value)
                texts.append((text_of, [*needs, *_implementations(id(value))]))
            hasher.update(f" {simple or places[id(value)]}".encode())
    return hasher.hexdigest()


def _implementations(key: int | str) -> list[types.FunctionType]:
    """What was registered outside of libraries for a thing, by its `id`, or for an attribute."""
    return _registered(len(builtin_registry.globals), len(builtin_registry.attributes)).get(key, [])


@cache
def _registered(*sizes: int) -> dict[int | str, list[types.FunctionType]]:
    """All that Numba's `overload` and its like were told, at these sizes of their lists."""
    templates: list[tuple[int | str, Any]] = [
        (id(value), one)
        for value, kind in builtin_registry.globals
        for one in getattr(kind, "templates", ())
    ]
    templates += [(getattr(one, "_attr", ""), one) for one in builtin_registry.attributes]
    found: dict[int | str, list[types.FunctionType]] = {}
    for key, template in templates:
        function = getattr(template, "_overload_func", None)
        if function and not _is_library(function.__code__.co_filename):
            found.setdefault(key, []).append(function)
    return found


def _text_of_value(value: Any) -> str | None:
    """Numbers, words, arrays and sequences of them in words; None for all else."""
    match value:
        case None | bool() | int() | float() | complex() | str() | bytes() | np.dtype():
            return f"{type(value).__name__} {value!r}"
        case np.generic():
            return f"{value.dtype} {value.tobytes()!r}"
        case np.ndarray() if not value.dtype.hasobject:
            return f"array {value.dtype} {value.shape} {_hash(value.tobytes())}"
        case tuple() | list() if type(value) in (tuple, list):
            inside = [_text_of_value(item) for item in value]
            return None if None in inside else f"{type(value).__name__} {inside}"
    return None


def _text_of_thing(value: Any) -> tuple[str, Sequence[Any]]:
    """All other things in words, and what these refer to."""
    match value:
        case Dispatcher():
            text, needed = _text_of_function(value.py_func, followed=True)
            return f"kernel {sorted(value.targetoptions.items())} {text}", needed
        case types.FunctionType():
            return _text_of_function(value, followed=not _is_library(value.__code__.co_filename))
        case types.ModuleType():
            return f"module {value.__name__}", ()
        case type():
            file = getattr(sys.modules.get(value.__module__), "__file__", None) or ""
            members = [(one.name, one.value) for one in value] if _is_enum(value) else ()
            return f"class {value.__module__}.{value.__qualname__} {_file_hash(file)}", members
        case enum.Enum():
            return f"member {value.name}", (type(value), value.value)
        case tuple() | list():
            return "sequence", (type(value), *value)
        case dict():
            return "mapping", (*value, *value.values())
    for made_of in ("py_func", "_defn"):  # universal functions, intrinsics
        if isinstance(function := getattr(value, made_of, None), types.FunctionType):
            return type(value).__name__, (function,)
    name = getattr(value, "__qualname__", None) or getattr(value, "__name__", None)
    if callable(value) and name:
        return f"{type(value).__name__} {getattr(value, '__module__', '')}.{name}", ()
    if " at 0x" in (text := repr(value)):
        raise Unknown(text)
    return f"{type(value).__qualname__} {text}", ()


def _is_enum(cls: type) -> TypeGuard[type[enum.Enum]]:
    return issubclass(cls, enum.Enum)


def _text_of_function(function: types.FunctionType, followed: bool) -> tuple[str, Sequence[Any]]:
    """A function's program and file; what it names, and of modules what it names behind them."""
    code = function.__code__
    text = f"function {function.__module__}.{function.__qualname__} {_file_hash(code.co_filename)}"
    if not followed:
        return text, ()
    names, program = _program(code)
    found: list[Any] = [cell.cell_contents for cell in function.__closure__ or ()]
    found += [function.__defaults__, *(function.__kwdefaults__ or {}).items()]
    found += [one for name in sorted(names) for one in _implementations(name)]
    spaces = [function.__globals__]
    for space in spaces:  # grows meanwhile
        for name in sorted(names & space.keys()):
            found += name, space[name]
            if isinstance(space[name], types.ModuleType):
                inner = vars(space[name])
                if all(inner is not known for known in spaces):
                    spaces.append(inner)
    return f"{text} {program}", found


@cache
def _program(code: types.CodeType) -> tuple[set[str], str]:
    """The names that a program and those inside it use, and all of it in words."""
    names, inside = set(code.co_names), []
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            inner, text = _program(constant)
            names |= inner
            inside.append(text)
        elif isinstance(constant, frozenset):
            inside.append(repr(sorted(map(repr, constant))))
        else:
            inside.append(repr(constant))
    shape = code.co_argcount, code.co_kwonlyargcount, code.co_flags
    words = code.co_names, code.co_varnames, code.co_cellvars, code.co_freevars
    return names, f"{code.co_code!r} {inside} {shape} {words}"


def _is_library(file: str) -> bool:
    return bool(_INSTALLED.search(file)) or file.startswith(_STANDARD)


def _file_hash(file: str) -> str:
    """A hash of a source file; `Unknown` where it is not as it was when this process read it.

    It stands for what cannot be followed, such as implementations that were registered elsewhere
    in the file for a function.
    """
    if not file.endswith(".py"):
        return ""
    try:
        state = Path(file).stat()
    except OSError:
        return ""
    if state.st_mtime > _STARTED:
        raise Unknown(file)
    return _content_hash(file, state.st_mtime_ns, state.st_size)


@cache
def _content_hash(file: str, modified: int, size: int) -> str:
    return _hash(Path(file).read_bytes())


def _hash(content: bytes) -> str:
    return _checksum(content).hex()


def _checksum(content: bytes) -> bytes:
    return hashlib.blake2b(content, digest_size=CHECKSUM_BYTES).digest()


def _path_of(kept: Any, signature: Any, codegen: Any) -> Path | None:
    """The file of a function's machine code for one signature and processor."""
    place = folder()
    if place is None:
        return None
    options = sorted(getattr(kept, "options", {}).items())
    switches = [getattr(config, name, None) for name in _SWITCHES]
    try:
        depends = dependencies(kept._py_func)
    except Unknown:
        return None
    kind = type(kept).__qualname__
    text = f"{_VERSIONS} {switches} {kind} {options} {depends} {signature} {codegen.magic_tuple()}"
    name = re.sub(r"\W+", "-", kept._py_func.__qualname__)[-60:]
    return place / f"{name}-{_hash(text.encode())}{SUFFIX}"


def _load(kept: Any, signature: Any, context: Any) -> Any:
    """What Numba keeps, of a function for a signature; None where it is not there or damaged."""
    path = _path_of(kept, signature, context.codegen())
    if path is None:
        return None
    try:
        content = path.read_bytes()
        if _checksum(content[CHECKSUM_BYTES:]) != content[:CHECKSUM_BYTES]:
            _tell(f"{path.parent}: damaged kernels are there; they are compiled anew")
            return None
        meant, reduced = pickle.loads(content[CHECKSUM_BYTES:])
        if meant != signature:
            return None
        found = kept._impl.rebuild(context, reduced)
    except FileNotFoundError:
        return None
    except Exception as error:  # whatever reading and linking it may raise: it is compiled instead
        kind = type(error).__name__
        _tell(f"{path.parent}: kernels there cannot be used ({kind}); they are compiled anew")
        return None
    with contextlib.suppress(OSError):
        os.utime(path)
    return found


def _save(kept: Any, signature: Any, compiled: Any) -> None:
    """Keep what was compiled, whole or not at all; without room for it things go on."""
    if not kept._impl.check_cachable(compiled):
        return
    path = _path_of(kept, signature, compiled.codegen)
    if path is None:
        return
    content = dumps((signature, kept._impl.reduce(compiled)))
    temporary = path.with_name(f".{path.name}.{os.getpid()}.{threading.get_ident()}")
    try:
        temporary.write_bytes(_checksum(content) + content)
        temporary.replace(path)
        _make_room(path.parent)
    except OSError as error:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)
        _tell(
            f"{path.parent}: compiled kernels cannot be kept ({error.strerror}); free some space, "
            "or set NUMBA_CACHE_DIR to another folder"
        )


@cache
def _make_room(place: Path) -> None:
    """Remove, once, the kernels beyond `MOST_BYTES` that were not used for longest."""
    found = [(path, path.stat()) for path in place.glob(f"*{SUFFIX}")]
    total = 0
    for path, state in sorted(found, key=lambda one: one[1].st_mtime, reverse=True):
        total += state.st_size
        if total > MOST_BYTES:
            path.unlink(missing_ok=True)


class _Locator(caching._CacheLocator):
    """What Numba asks for a place. `_load` and `_save` find their own; this one fits any function.

    Numba warns by its attributes of functions that cannot be kept.
    """

    def __init__(self, file: str) -> None:
        self._py_file = file

    def get_cache_path(self) -> str:
        return str(folder() or "")

    def get_source_stamp(self) -> str:
        return ""

    def get_disambiguator(self) -> str:
        return ""

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> "_Locator":
        return cls(py_file)


def _enable(dispatcher: Any) -> None:
    """Have a kernel kept; how it is compiled counts, too."""
    dispatcher._cache = caching.FunctionCache(dispatcher.py_func)
    dispatcher._cache.options = dispatcher.targetoptions


def take_over() -> None:
    """Have Numba keep machine code as this file says."""
    replaced: list[tuple[Any, str, Any]] = [
        (caching.CacheImpl, "_locator_classes", [_Locator]),
        (caching.Cache, "_load_overload", _load),
        (caching.Cache, "_save_overload", _save),
        (caching.Cache, "flush", lambda kept: None),
        (Dispatcher, "enable_caching", _enable),
    ]
    for place, name, ours in replaced:
        setattr(place, name, ours)


take_over()
