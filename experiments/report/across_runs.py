"""What published runs say together: orders beside the papers', on other maps, scenes and sizes."""

from collections.abc import Iterator, Sequence

from experiments.report.other_maps import on_other_maps
from experiments.report.other_scenes import on_other_scenes
from experiments.report.other_sizes import in_other_sizes
from experiments.report.parts import Part
from experiments.report.reproduced import reproduced
from experiments.run.loaded_run import Run


def across_runs(runs: Sequence[Run]) -> Iterator[Part]:
    """Sentences and tables under headings of their own."""
    yield from reproduced(runs)
    yield from on_other_maps(runs)
    yield from on_other_scenes(runs)
    yield from in_other_sizes(runs)
