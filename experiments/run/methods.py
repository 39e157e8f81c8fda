"""Which state of the methods a run is of: one digest of samplers, renderer and metrics.

Commits come and go by words and studies; runs with the same digest were measured by the same
programs.
"""

from pathlib import Path

import metrics
import renderer
import samplers
from experiments.run.identity import dependencies, digest, program_digest

PACKAGES = (samplers, renderer, metrics)
NOT_MEASURED = ("conformance", "__pycache__")
"""Folders whose files have no part in a measurement, or only where others import them."""
MEASURING = ("experiments.run.rendering", "experiments.run.judging")


def methods_digest() -> str:
    """A hash of all programs of samplers, renderer and metrics, and of what renders and judges."""
    files = dict(dependencies(*MEASURING))
    for package in PACKAGES:
        root = Path(package.__path__[0])
        for path in root.rglob("*"):
            inside = path.relative_to(root).parts
            if _counts(path) and not set(inside) & set(NOT_MEASURED):
                files["/".join((root.name, *inside))] = path
    return digest({name: program_digest(path) for name, path in files.items()})


def _counts(path: Path) -> bool:
    return path.is_file() and (path.suffix == ".py" or path.parent.name == "data")
