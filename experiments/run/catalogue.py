"""The experiments that `envlight run` knows: names, one line about each, and where they are.

An experiment is one module of this package with `run(request: RunRequest, dry_run: bool) -> int`,
which returns the exit status; with `dry_run` it only says what it would measure. Modules are
imported when their experiment runs, so that listing them costs nothing.
"""

import difflib
import importlib
from types import ModuleType

from samplers import EnvlightError

CATALOGUE: dict[str, tuple[str, str]] = {
    "table1": (
        "experiments.wu2025.table1",
        "Mean RMSE and FLIP with mean ranks over maps and scenes.",
    ),
    "ranking": (
        "experiments.wu2025.ranking",
        "Rank per map, distribution of ranks, critical-difference diagrams.",
    ),
    "table2": (
        "experiments.wu2025.table2",
        "Ablation of EnvDirects: masking and k-means on and off.",
    ),
    "illumination-cut": (
        "experiments.wu2025.illumination_cut",
        "Modified against original illumination cut: errors, false shadow edges, images.",
    ),
    "equal-time": (
        "experiments.wu2025.equal_time",
        "Image strips, error maps and numbers of all methods in the same time.",
    ),
    "glossy": (
        "experiments.wu2025.glossy",
        "Highly glossy materials: all methods in the same time.",
    ),
    "convergence": (
        "experiments.questions.convergence",
        "Run time against error: slopes, Pareto fronts, the best sampler in a given time.",
    ),
    "light-generation-time": (
        "experiments.wu2025.light_generation_time",
        "Time and memory to generate lights per method, map size and count.",
    ),
    "kd-tree-throughput": (
        "experiments.ergun2012.kd_tree_throughput",
        "Samples per second of the kd-tree, binary search, guided search and alias table.",
    ),
    "renderer-throughput": (
        "experiments.questions.renderer_throughput.study",
        "Shadow rays per second beside bare Embree, embreex and, where installed, Mitsuba.",
    ),
    "paper-budget": (
        "experiments.questions.paper_budget",
        "Whether 4 s at 1600×1200 pixels can be kept by every sampler, and its peak memory.",
    ),
    "reference-time": (
        "experiments.questions.reference_time",
        "Time to bring a reference at 640×480 pixels to its noise target, per map and scene.",
    ),
    "skipping": (
        "experiments.questions.skipping",
        "Rays, seconds and image difference with each skip on and off.",
    ),
    "discrepancy": (
        "experiments.wan2005.discrepancy",
        "Generalised spherical discrepancy of five patterns of directions.",
    ),
    "area-lights": (
        "experiments.arbree2005.area_lights",
        "Number, size and time of area lights per map, and their images with soft shadows.",
    ),
    "stability": (
        "experiments.questions.stability.study",
        "Numerical stress test: sampler × stress map × property; float32 against float64.",
    ),
    "static-sampling": (
        "experiments.wan2005.static_sampling",
        "Patterns of 300 lights and the PSNR of images lit by them, per method.",
    ),
    "dynamic-sequence": (
        "experiments.wan2005.dynamic_sequence",
        "A spreading fire: change of lights and images between frames, times of the Q²-tree.",
    ),
    "kd-tree-quality": (
        "experiments.ergun2012.kd_tree_quality",
        "Compression and fit of kd-tree cases, and PSNR beside inversion at equal time.",
    ),
    "light-distribution": (
        "experiments.wu2025.light_distribution",
        "Emissive regions and lights drawn on the maps, and how they lie to each other.",
    ),
}


def experiment_names() -> list[str]:
    """All names, table1 first."""
    return list(CATALOGUE)


def description(name: str) -> str:
    """What an experiment measures, in one line."""
    return CATALOGUE[name][1]


def find_experiment(name: str) -> ModuleType:
    """The module of an experiment; EnvlightError with the nearest names for an unknown one."""
    if name not in CATALOGUE:
        near = difflib.get_close_matches(name, CATALOGUE, n=3, cutoff=0.4) or experiment_names()
        raise EnvlightError(f"no experiment is called '{name}'; did you mean {', '.join(near)}?")
    return importlib.import_module(CATALOGUE[name][0])
