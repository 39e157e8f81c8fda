"""How calm lights and images stay while a fire spreads through a still place, frame by frame.

Reproduces section 6 and Figure 10 of Wan, Wong and Leung, "Spherical Q²-tree for sampling dynamic
environment sequences", EGSR 2005. Every method makes 300 lights for each frame, with the same seed.
Between consecutive frames these are compared:

lights : light energy moved × angle, the least that makes one set of the other (see
    `metrics.transport`), in degrees per unit of energy; beside it that of the maps themselves, on a
    coarse grid, and that of the lights where no flame ever is and nothing should move
kept : share of the energy of those lights that stay exactly as they are
images : temporal noise, the RMSE of (Iₜ − Iₜ₋₁) − (Rₜ − Rₜ₋₁) with R the references, at one
    exposure for all frames; over the true change, the RMS of Rₜ − Rₜ₋₁

The paper shows three frames and a video and gives no number for any of these. Its times, 0.70 s a
frame alone and 0.41 s from the frame before, stand beside those of the Q²-tree built from scratch
and mended, which must give the same lights; both are timed in interleaved rounds on each frame,
from the map to its lights and the tree by itself.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from experiments.maps import places
from experiments.maps.sources import EMBEDDED
from experiments.report.light_pattern import draw_pattern
from experiments.report.sheets import keep_tile, tile_path
from experiments.run.case import Case
from experiments.run.experiment import Group, Job, Row, Study, experiment
from experiments.run.request import RunRequest
from experiments.run.runner import run_folder
from experiments.run.scale import find_scale
from experiments.run.scene_choice import choose_scenes, name_and_file
from experiments.run.study_run import study_environments
from experiments.wan2005.fire_sequence import FireSequence
from experiments.wan2005.fixed_sets import COUNT, chosen_fixed_sets
from experiments.wan2005.frame_changes import (
    Frames,
    changes,
    lights_alone,
    lights_calmed,
    tree_times,
)
from experiments.wan2005.sequence_sections import (
    OWN,
    REFERENCE,
    SHOWN,
    TIMING,
    changes_section,
    times_section,
)
from metrics.truth import Image
from samplers import DirectionalLights, Lighting

NAME, MEASURING = "dynamic-sequence", "experiments.wan2005.frame_changes"
SCENES, STILL = ["insect"], ["gallery-skylight"]
"""A bee under a bright window far above the fire, as in the paper."""
WINDOW = {"quick": (86, 93), "standard": (60, 108), "paper": (0, places.FIRE_FRAMES)}
"""Frames rendered, the last exclusive. All hold the paper's 89 to 91."""
NOISE_TARGET, MOST_SAMPLES = {"quick": 0.008, "standard": 0.005, "paper": 0.003}, 16384
ROUNDS = {"quick": 5, "standard": 7, "paper": 7}
TOLERANCE = 0.25
CALMED = f"q2-tree, tolerance {TOLERANCE}"
"""The tree of the frame before, mended until importances are that close to their order."""


@experiment(NAME)
def dynamic_sequence() -> Study:
    """Change of lights and images from frame to frame of a fire, and the Q²-tree's times."""
    return Study(
        title="Change between frames of a fire (Wan, Wong and Leung 2005, section 6)",
        sections=(changes_section, times_section),
        groups=groups,
        sources=(MEASURING,),
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per scene, place and method, and one of the Q²-tree's times."""
    scale = find_scale(request.scale)
    noise = request.reference_noise or NOISE_TARGET[scale.name]
    scale = replace(scale, noise_target=noise, max_samples=MOST_SAMPLES)
    patterns = request.maps or (STILL if request.environments == EMBEDDED else [])
    count = request.lights(COUNT)
    specs = {spec.label: spec for spec in chosen_fixed_sets(request.samplers, count)}
    folder = run_folder(request.output, NAME, request.scale)
    found = []
    for source in study_environments(request, patterns, scale.map_height):
        for name, file in map(name_and_file, choose_scenes(request.scenes or SCENES)):
            sequence = FireSequence(Case(name, source, scale, file), folder)
            lights: dict[str, Callable[[Sequence[int]], Frames]] = {
                label: partial(lights_alone, sequence, spec, count) for label, spec in specs.items()
            }
            identities = {label: spec.identity for label, spec in specs.items()}
            if OWN in specs:
                lights[CALMED] = partial(lights_calmed, sequence, TOLERANCE, count)
                identities[CALMED] = identities[OWN]
            found += [
                _changes_group(sequence, label, make, identities[label], count)
                for label, make in lights.items()
            ]
            if OWN in specs:
                found.append(_times_group(sequence, identities[OWN], count, ROUNDS[scale.name]))
    return found


def _jobs(sequence: FireSequence, method: str, depends: Row, count: int) -> dict[str, Job]:
    case = sequence.still
    first, stop = WINDOW[case.scale.name]
    return {
        str(frame): Job(
            {
                "scene": case.scene, "environment": case.environment.name, "method": method,
                "count": count, "frame": frame,
            },
            {"still": case.reference_identity, **depends},
        )
        for frame in range(first + 1, stop)
    }  # fmt: skip


def _changes_group(
    sequence: FireSequence, label: str, lights: Callable[[Sequence[int]], Frames], identity: Row,
    count: int,
) -> Group:  # fmt: skip
    """All frames of a method: each needs the one before, and a tree may need all before it."""
    case = sequence.still

    def seen(frame: int, lighting: Lighting, image: Image) -> None:
        if frame in SHOWN:
            _keep_tiles(sequence, label, frame, lighting, image)

    def measure(names: Sequence[str]) -> dict[str, Row]:
        rows = changes(sequence, lights(range(*WINDOW[case.scale.name])), seen)
        return {name: rows[int(name)] for name in names}

    jobs = _jobs(sequence, label, {"sampler": identity}, count)
    return Group(f"{case}, {label}", jobs, measure)


def _times_group(sequence: FireSequence, identity: Row, count: int, rounds: int) -> Group:
    def measure(names: Sequence[str]) -> dict[str, Row]:
        return {name: tree_times(sequence, int(name), count, rounds) for name in names}

    jobs = _jobs(sequence, TIMING, {"sampler": identity, "rounds": rounds}, count)
    return Group(f"{sequence.still}, times of the Q²-tree", jobs, measure)


def _keep_tiles(
    sequence: FireSequence, label: str, frame: int, lighting: Lighting, image: Image
) -> None:
    case, map_now = sequence.still, sequence.map(frame)
    truth = sequence.truth(frame).image
    for method, picture, lights in (
        (REFERENCE, truth, DirectionalLights.none()), (label, image, lighting)
    ):  # fmt: skip
        where = case.scene, case.environment.name, method, frame
        keep_tile(tile_path(sequence.folder, "image", *where), picture)
        keep_tile(tile_path(sequence.folder, "pattern", *where), draw_pattern(map_now, lights))
