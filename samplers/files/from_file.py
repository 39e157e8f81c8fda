"""Samplers that live in a file of the user's own, named as FILE:CLASS.

`./my_sampler.py:MySampler` is loaded by its path, in whichever process asks for it. The file is an
ordinary module: it may import what is installed and what lies in its own folder. The sampler is
called by the name that `register` gave it, or by its class's in lower case with hyphens. It does
not enter the registry, so that nothing but its own mention selects it.
"""

import ast
import hashlib
import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from samplers.base import REGISTERED, LightSampler, register
from samplers.errors import EnvlightError, told
from samplers.files.plug_in_files import line_of, watch

SUFFIX = ".py"
PREFIX = "envlight_file_"
"""Modules loaded from files are called by this and a hash of their path and content."""


def is_file_reference(text: str) -> bool:
    """Whether a sampler's name is meant as FILE:CLASS, or as a file whose class was forgotten."""
    file, separator, _ = text.rpartition(":")
    return text.endswith(SUFFIX) or (bool(separator) and file.endswith(SUFFIX))


def split_reference(text: str) -> tuple[Path, str]:
    """The file, as an absolute path, and the class of FILE:CLASS; EnvlightError without a class."""
    file, _, name = (text, "", "") if text.endswith(SUFFIX) else text.rpartition(":")
    path = Path(file).expanduser()
    if not path.is_file():
        raise EnvlightError(f"sampler '{text}': {path} is no file; give the path of a Python file")
    if not name.isidentifier():
        found = class_names(path)
        like = f"{file}:{found[0]}" if found else "./my_sampler.py:MySampler"
        raise EnvlightError(f"sampler '{text}': name the class too, as in {like}")
    return path.resolve(), name


def class_names(path: Path) -> list[str]:
    """The classes that a file defines, without running it; none where it cannot be read."""
    try:
        tree = ast.parse(path.read_bytes())
    except (OSError, SyntaxError, ValueError):
        return []
    return [node.name for node in tree.body if isinstance(node, ast.ClassDef)]


def content_digest(path: Path) -> str:
    """A hash of the file's bytes; EnvlightError where it cannot be read."""
    try:
        return hashlib.blake2b(path.read_bytes(), digest_size=12).hexdigest()
    except OSError as error:
        raise EnvlightError(f"{path}: cannot be read ({error.strerror}); check the file") from None


def load_class(text: str) -> type[LightSampler]:
    """The class that FILE:CLASS names. A file is run once per process and content.

    What the file registers is taken out of the registry again.
    Raises EnvlightError where the file or the class is missing, the file cannot be run, the class
    is no sampler, or its name is that of another sampler.
    """
    path, name = split_reference(text)
    module = _module(path)
    cls = getattr(module, name, None)
    if cls is None:
        found = ", ".join(class_names(path)) or "none"
        raise EnvlightError(f"{path}: it has no class '{name}'; its classes: {found}")
    if not (isinstance(cls, type) and issubclass(cls, LightSampler)) or cls is LightSampler:
        raise EnvlightError(
            f"{path}: '{name}' is not a LightSampler; derive it from samplers.LightSampler"
        )
    missing = sorted(getattr(cls, "__abstractmethods__", ()))
    if missing:
        raise EnvlightError(f"{path}: class '{name}' has no method {missing[0]}; write it")
    before = dict(REGISTERED)
    try:
        return register(vars(cls).get("name") or _hyphenated(name))(cls)
    except EnvlightError as error:
        raise EnvlightError(f"{path}: {error}") from None
    finally:
        _restore(before)


def _module(path: Path) -> ModuleType:
    called = PREFIX + hashlib.blake2b(f"{path}\n{content_digest(path)}".encode()).hexdigest()[:16]
    if called in sys.modules:
        return sys.modules[called]
    spec = importlib.util.spec_from_file_location(called, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    folder = str(path.parent)
    watch(path.parent)
    if folder not in sys.path:
        sys.path.append(folder)  # last, so that nothing of the folder hides what is installed
    sys.modules[called] = module
    before = dict(REGISTERED)
    try:
        spec.loader.exec_module(module)
    except BaseException as error:
        del sys.modules[called]
        if not isinstance(error, Exception | SystemExit):
            raise
        raise EnvlightError(_told(error, path)) from error
    finally:
        _restore(before)
    return module


def _restore(before: dict[str, Any]) -> None:
    REGISTERED.clear()
    REGISTERED.update(before)


def _told(error: BaseException, path: Path) -> str:
    """What went wrong while a file was run, with the line of it or of what it imports."""
    if isinstance(error, EnvlightError):
        return f"{path}: {error}"
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}: line {error.lineno}: {error.msg}; correct the line"
    return f"{line_of(error) or path}: {told(error)}; correct the line"


def _hyphenated(name: str) -> str:
    """MySampler as my-sampler."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "-", name).lower()
