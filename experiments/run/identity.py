"""What a result depends on: digests of values and of source code, and versions of libraries.

A module's source counts together with all project source that it imports, directly or not, also
inside functions, and with the packages on the way to it; imports for type checkers alone do not.
Of source, what runs counts: neither comments nor docstrings, nor how it is laid out.
What is only found at run time, as samplers and scenes are by their registries, does not count: an
edit of one sampler leaves the others' results alone. A file in a package's `data/` counts with the
modules that name it. A file of the user's own counts with what it imports that is not installed,
and with the files that it names or reads while it is loaded. Other packages that this source
imports count by their installed version.
"""

import ast
import hashlib
import importlib.metadata
import importlib.util
import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from samplers import EnvlightError
from samplers.files.from_file import PREFIX as FROM_FILE
from samplers.files.plug_in_files import NOT_OWN, data_files

PACKAGES = frozenset({"samplers", "renderer", "metrics", "experiments"})
METHODS = ("samplers", "renderer", "metrics")
"""The packages whose files tell which state of the methods a run is of."""
NOT_MEASURED = ("conformance", "__pycache__")
"""Folders whose files have no part in a measurement, or only where others import them."""
MEASURING = ("experiments.run.rendering", "experiments.run.judging")
ALONE = " alone"
"""Behind a module's name where its own file counts, and nothing that it imports."""
WITHOUT_EFFECT = frozenset({"platformdirs"})
"""Libraries whose version cannot change a result: this one names folders."""


@dataclass(frozen=True, eq=False)
class Shared:
    """A part that many identities have; in their JSON and hashes its own hash stands for it."""

    value: dict[str, Any]

    @cached_property
    def key(self) -> str:
        return digest(self.value)


_JSON = json.JSONEncoder(sort_keys=True, ensure_ascii=False, default=lambda shared: shared.key)


def as_json(value: Any) -> str:
    """JSON with sorted keys, in which hashes stand for shared parts."""
    return _JSON.encode(value)


def digest(value: Any) -> str:
    """A short hexadecimal hash of anything JSON can hold; keys are sorted first."""
    return hashlib.blake2b(as_json(value).encode(), digest_size=12).hexdigest()


def file_digest(path: Path) -> str:
    """A hash of a file's bytes; EnvlightError where it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=12)).hexdigest()
    except OSError as error:
        raise EnvlightError(f"{path}: cannot be read ({error.strerror}); check the file") from error


def module_digest(name: str) -> str:
    """A hash of one module's own file, without what it imports."""
    module = _module(name)
    assert module is not None, name
    return program_digest(module.path)


def program_digest(path: Path) -> str:
    """A hash of a Python file's program, the same for any wording of its comments and docstrings;
    of another file's bytes.
    """
    return _source(path).program if path.suffix == ".py" else file_digest(path)


@dataclass(frozen=True)
class _Source:
    """program : a hash of what runs; loaded : modules that are imported by a call, by name; words :
    its strings
    """

    program: str
    imports: tuple[ast.Import | ast.ImportFrom, ...]
    loaded: frozenset[str]
    words: frozenset[str]


@cache
def _source(path: Path) -> _Source:
    tree = ast.parse(path.read_bytes())
    imports: list[ast.Import | ast.ImportFrom] = []
    loaded: set[str] = set()
    words: set[str] = set()
    for node in _that_runs(tree):
        match node:
            case ast.Import() | ast.ImportFrom():
                imports.append(node)
            case ast.Call(
                func=ast.Attribute(attr="find_spec" | "import_module"),
                args=[ast.Constant(value=str(name))],
            ):
                loaded.add(name)
            case ast.Constant(value=str(word)):
                words.add(word)
    return _Source(digest(_program(tree)), tuple(imports), frozenset(loaded), frozenset(words))


def _program(node: Any) -> str:
    """A syntax tree in words, without the strings that stand as statements of their own.

    Fields that hold nothing are left out: other versions of Python have more of them.
    """
    if isinstance(node, ast.AST):
        fields = [(field, getattr(node, field, None)) for field in node._fields]
        kept = (f"{name}={_program(value)}" for name, value in fields if value not in (None, []))
        return f"{type(node).__name__}({','.join(kept)})"
    if isinstance(node, list):
        return f"[{','.join(_program(item) for item in node if not _is_docstring(item))}]"
    return repr(node)


def _is_docstring(node: Any) -> bool:
    if not isinstance(node, ast.Expr) or not isinstance(node.value, ast.Constant):
        return False
    return isinstance(node.value.value, str)


@dataclass(frozen=True)
class _Module:
    """imports : absolute names that may be modules, or members of modules; data : files it names or
    reads, by what they are called
    """

    path: Path
    imports: frozenset[str]
    data: dict[str, Path]


@cache
def _module(name: str) -> _Module | None:
    """A module's file and what it needs; None for a name that is no module with Python source."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError):
        return None
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        return None
    path = Path(spec.origin)
    package = name if spec.submodule_search_locations else name.rpartition(".")[0]
    source = _source(path)
    imports = set(source.loaded)
    for node in source.imports:
        if isinstance(node, ast.Import):
            imports |= {alias.name for alias in node.names}
            continue
        base = importlib.util.resolve_name("." * node.level + (node.module or ""), package)
        imports |= {base, *(f"{base}.{alias.name}" for alias in node.names)}
    named = (file for file in (path.parent / "data").glob("*") if file.name in source.words)
    data = {file.name: file for file in named} | data_files(path)
    return _Module(path, frozenset(imports), data)


def _that_runs(tree: ast.AST) -> Iterator[ast.AST]:
    """The nodes of a tree without those that only type checkers look at."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        yield node
        match node:
            case ast.If(test=ast.Name(id="TYPE_CHECKING"), orelse=otherwise):
                waiting += otherwise
            case _:
                waiting += ast.iter_child_nodes(node)


def _closure(modules: tuple[str, ...]) -> dict[str, _Module]:
    """The modules and all project source that they need, by name."""
    found: dict[str, _Module] = {}
    waiting = list(modules)
    while waiting:
        name = waiting.pop()
        if name in found or not _is_own(name.partition(".")[0], modules):
            continue
        module = _module(name)
        if module is None:
            continue
        found[name] = module
        waiting += [*module.imports, name.rpartition(".")[0] or name]
    return found


def _is_own(root: str, modules: tuple[str, ...]) -> bool:
    """Whether the source of a module or package counts with these modules: the project's, and with
    files of the user's own what is neither Python's nor installed.
    """
    if root in PACKAGES or root in {name.partition(".")[0] for name in modules}:
        return True
    return any(name.startswith(FROM_FILE) for name in modules) and _is_users(root)


def _is_users(root: str) -> bool:
    try:
        spec = None if root in sys.stdlib_module_names else importlib.util.find_spec(root)
    except (ImportError, ValueError):
        return False
    places = [spec.origin, *(spec.submodule_search_locations or ())] if spec else []
    return bool(places) and not any(NOT_OWN & set(Path(place or "").parts) for place in places)


def dependencies(*modules: str) -> dict[str, Path]:
    """Source and data files that the modules depend on, themselves included, by name."""
    found: dict[str, Path] = {}
    for name, module in _closure(modules).items():
        found[name] = module.path
        found |= {f"{name}:{called}": file for called, file in module.data.items()}
    return found


@cache
def source_digest(*modules: str) -> str:
    """A hash of the modules' source and of all that they depend on."""
    return digest({name: program_digest(path) for name, path in dependencies(*modules).items()})


def programs(*modules: str) -> dict[str, str]:
    """What `source_digest` says of each module, by its name."""
    return {name: source_digest(name) for name in modules}


def own_programs(*modules: str) -> dict[str, str]:
    """What `module_digest` says of each module; what they import is told elsewhere."""
    return {f"{name}{ALONE}": module_digest(name) for name in modules}


def methods_digest() -> str:
    """A hash of all programs of samplers, renderer and metrics, and of what renders and judges.

    Commits come and go by words and studies; runs of one hash were measured by the same programs.
    """
    files = dict(dependencies(*MEASURING))
    for package in METHODS:
        root = _package_folder(package)
        for path in root.rglob("*"):
            inside = path.relative_to(root).parts
            counts = path.is_file() and (path.suffix == ".py" or path.parent.name == "data")
            if counts and not set(inside) & set(NOT_MEASURED):
                files["/".join((package, *inside))] = path
    return digest({name: program_digest(path) for name, path in files.items()})


def _package_folder(package: str) -> Path:
    module = _module(package)
    assert module is not None, package
    return module.path.parent


@cache
def library_versions(*modules: str) -> dict[str, str]:
    """The installed version of each package outside the project that the modules' source imports.

    One that is not installed stands as "none", since a module may do without it. llvmlite, by
    which Numba makes machine code, counts with Numba.
    """
    imported = {
        name.partition(".")[0] for module in _closure(modules).values() for name in module.imports
    }
    if "numba" in imported:
        imported.add("llvmlite")
    others = sorted(imported - sys.stdlib_module_names - WITHOUT_EFFECT)
    return {name: version_of(name) for name in others if not _is_own(name, modules)}


@cache
def version_of(package: str) -> str:
    """By the distribution of the same name, or by those that hold such a package: slow to find."""
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        found = _distributions().get(package, [])
        return ", ".join(sorted({importlib.metadata.version(name) for name in found})) or "none"


@cache
def _distributions() -> Mapping[str, list[str]]:
    return importlib.metadata.packages_distributions()
