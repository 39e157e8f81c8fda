"""What a result depends on: digests of values and of the source code that computes it."""

import ast
import hashlib
import importlib.util
import json
from functools import cache
from pathlib import Path
from typing import Any

PACKAGES = ("samplers", "renderer", "metrics", "experiments")


def digest(value: Any) -> str:
    """A short hexadecimal hash of anything JSON can hold; keys are sorted first."""
    text = json.dumps(value, sort_keys=True, ensure_ascii=False)
    return hashlib.blake2b(text.encode(), digest_size=12).hexdigest()


def file_digest(path: Path) -> str:
    """A hash of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=12)).hexdigest()


def _source_path(module: str) -> Path | None:
    try:
        spec = importlib.util.find_spec(module)
    except ModuleNotFoundError:
        return None
    return Path(spec.origin) if spec and spec.origin and spec.origin.endswith(".py") else None


@cache
def _imports(path: Path) -> frozenset[str]:
    """The project's own modules that a file imports, anywhere in it."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            found.add(node.module)
            found.update(f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
    return frozenset(name for name in found if name.split(".")[0] in PACKAGES)


@cache
def source_digest(*modules: str) -> str:
    """A hash of the modules' source and of all project source that they import, directly or not.

    Data files beside the code (`data/` of a package) count with the modules of their package.
    """
    paths: dict[str, Path] = {}
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        path = None if name in paths else _source_path(name)
        if path is None:
            continue
        paths[name] = path
        waiting.extend(_imports(path))
    files = set(paths.values())
    files |= {file for path in paths.values() for file in (path.parent / "data").glob("*.*")}
    return digest(sorted(f"{file.name}:{file_digest(file)}" for file in files))
