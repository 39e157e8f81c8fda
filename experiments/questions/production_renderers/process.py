"""The renderers' own Python: what is installed there, and a written scene rendered in a process.

They take 1.6 GB, and two of them cannot live in one process, so they stay out of this
project's environment. `make renderers` makes one for them; ENVLIGHT_RENDERERS names another Python.
A renderer that is missing or ends its process is an EnvlightError, and costs no other.
"""

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

from samplers import EnvlightError

VARIABLE = "ENVLIGHT_RENDERERS"
OWN_PYTHON = Path(".venv-renderers", "bin", "python")
"""Below the project's folder: the working one, or that of the source."""
MOST_SECONDS = 1800.0
"""A process that takes longer has lost its way."""
PROBE = """
import importlib.metadata, json, sys
found = {}
for name in sys.argv[1:]:
    try:
        found[name] = importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        pass
print(json.dumps(found))
"""


@dataclass(frozen=True)
class Render:
    """One rendering: samples a pixel, a seed, and the file for it, .npy or .exr."""

    samples: int
    seed: int
    output: str


def renderers_python() -> Path:
    """The Python in which renderers are looked for: this one where there is none of their own."""
    named = os.environ.get(VARIABLE)
    if named:
        return Path(named)
    source = Path(__file__).parents[3]
    own = (folder / OWN_PYTHON for folder in (Path.cwd(), source))
    return next((python for python in own if python.is_file()), Path(sys.executable))


@cache
def installed(python: Path, packages: tuple[str, ...]) -> Mapping[str, str]:
    """Versions of those of the packages that a Python has."""
    try:
        found = subprocess.run(
            [python, "-c", PROBE, *packages], capture_output=True, text=True, check=True, timeout=60
        )
        versions: dict[str, str] = json.loads(found.stdout)
    except (OSError, ValueError, subprocess.SubprocessError) as error:
        raise EnvlightError(
            f"{VARIABLE}: {python} does not work as a Python ({error}); name another"
        ) from error
    return versions


def require(package: str, label: str) -> str:
    """The version of a renderer's package; EnvlightError where it is missing."""
    versions = installed(renderers_python(), (package,))
    if package not in versions:
        raise EnvlightError(
            f"{label}: the package {package} is not installed; `make renderers` sets it up, or "
            f"{VARIABLE} names a Python that has it"
        )
    return versions[package]


def render_scene(
    folder: Path,
    renders: Sequence[Render],
    label: str,
    threads: int,
    environment: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Render a written scene several times in one process; returns the program's report.

    environment : variables of the process beside those of this one

    Raises EnvlightError with the last words of a process that failed, and after `MOST_SECONDS`.
    """
    plan, report = folder / "plan.json", folder / "report.json"
    content = {"threads": threads, "renders": [asdict(one) for one in renders],
               "report": str(report.resolve())}  # fmt: skip
    plan.write_text(json.dumps(content), encoding="utf-8")
    report.unlink(missing_ok=True)
    try:
        ended = subprocess.run(
            [renderers_python().absolute(), "render.py", "--plan", "plan.json"],
            cwd=folder, env={**_plain_environment(), **(environment or {})},
            capture_output=True, text=True, errors="replace", timeout=MOST_SECONDS,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise EnvlightError(f"{label}: stopped after {MOST_SECONDS:.0f} s") from None
    except OSError as error:
        raise EnvlightError(f"{label}: its Python cannot be started ({error})") from error
    found = json.loads(report.read_text(encoding="utf-8")) if report.is_file() else {"renders": []}
    # Some end badly after all is done, when their libraries are unloaded.
    if len(found["renders"]) < len(renders):
        raise EnvlightError(f"{label}: {_last_words(ended)}")
    return dict(found)


def _plain_environment() -> dict[str, str]:
    """This process's variables without those that lead another Python to this one's packages."""
    return {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}


def _last_words(ended: subprocess.CompletedProcess[str]) -> str:
    lines = [line.strip() for line in ended.stderr.splitlines() if line.strip()]
    how = (
        f"its process was ended by signal {-ended.returncode}"
        if ended.returncode < 0
        else f"its process ended with status {ended.returncode}"
    )
    return f"{how}: {lines[-1][:200]}" if lines else how
