"""What runs where the user names no scenes or maps, so that scale quick takes minutes."""

from dataclasses import replace
from typing import TYPE_CHECKING

from experiments.maps.classes import representatives
from experiments.maps.sources import EMBEDDED
from experiments.wu2025.table1 import TEST_SCENES

if TYPE_CHECKING:
    from experiments.cli.commands import RunRequest

QUICK = "quick"
QUICK_SCENES = TEST_SCENES[:2]


def with_quick_scenes(request: "RunRequest") -> "RunRequest":
    """At scale quick, two of the four test scenes unless some are named."""
    if request.scale != QUICK or request.scenes:
        return request
    return replace(request, scenes=list(QUICK_SCENES))


def with_quick_maps(request: "RunRequest", per_class: int) -> "RunRequest":
    """At scale quick, the first few embedded maps of every kind unless others are named."""
    if request.scale != QUICK or request.maps or request.environments != EMBEDDED:
        return request
    return replace(request, maps=representatives(per_class))
