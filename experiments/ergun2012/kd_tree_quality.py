"""What a kd-tree keeps of a map, and the noise of images that are sampled by it.

Reproduces Figures 1, 2, 6 and 7 and the compression ratios of Ergun, Kurt and Öztürk, "Real-time
kd-tree based importance sampling of environment maps", SCCG 2012. See `kd_tree_blocks` for the
blocks: sizes, fits by number of blocks and criterion, pictures of the fitted density; and
`kd_tree_images` for PSNR at equal samples and at equal time beside inversion. Embedded maps are
2048 × 1024, as the paper's; its own maps (Uffizi, Doge2) cannot be passed on, and its materials are
refitted surrogates, so that levels of PSNR do not compare, gains may. Filtered importance sampling,
the third column of its Figure 7, is not in the registry.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path

from experiments.ergun2012 import kd_tree_blocks as fits
from experiments.ergun2012 import kd_tree_images as images
from experiments.ergun2012.kd_tree_throughput import METHODS
from experiments.maps.sources import EMBEDDED, EnvironmentSource
from experiments.run.request import RunRequest
from experiments.run.runner import run_folder
from experiments.run.sampler_spec import SamplerSpec
from experiments.run.scale import Scale, find_scale
from experiments.run.study import Group, Job, Row, Study, run_study, study_environments
from samplers import EnvironmentMap
from samplers.kd_tree.build import SELECTIONS

NAME = "kd-tree-quality"
HEIGHT = 1024
"""Rows of the embedded maps at every scale: the paper's, by which it counts compression."""
MAPS = {
    "quick": ["overcast-courtyard", "room-three-windows", "constant"],
    "standard": ["overcast-courtyard", "room-three-windows", "gothic-church", "fireplace-cabin",
                 "noon-desert", "concert-stage", "constant"],
    "paper": [],
}  # fmt: skip
"""A courtyard and a hall with windows stand for Uffizi and Doge2; at scale paper all 32."""
IMAGE_MAP = "room-three-windows"
BLOCKS = (16, 64, 256, 1024, 6144)
PAPER_BLOCKS, PIXELS = 6144, "sse, pixels alike"
"""The paper's number of blocks, and its criterion as published: pixels count alike."""
SPHERES = ("pink-fabric", "blue-metallic-paint", "chrome-steel", "brushed-metal")
SCENES = {
    "quick": [*((images.SPHERE, m) for m in SPHERES), (images.TEAPOT, "chrome-steel")],
    "standard": [(scene, m) for scene in (images.SPHERE, images.TEAPOT) for m in SPHERES],
}
SAMPLES = {"quick": (8, 32), "standard": (8, 32, 128), "paper": (8, 32, 128)}
SIZE = {"quick": 96, "standard": 256, "paper": 512}
ROUNDS = {"quick": 5, "standard": 9, "paper": 9}
NOISE_TARGET, MOST_SAMPLES = {"quick": 0.008, "standard": 0.004, "paper": 0.002}, 16384
FITS, IMAGES = "fits", "images"


@dataclass(frozen=True)
class _Work:
    """Pictures and references go to `folder`."""

    source: EnvironmentSource
    folder: Path

    def load(self) -> EnvironmentMap:
        return _loaded(self.source)


@lru_cache(maxsize=2)
def _loaded(source: EnvironmentSource) -> EnvironmentMap:
    return source.load()


def run(request: RunRequest, dry_run: bool) -> int:
    """Run the experiment; returns the exit status."""
    from experiments.ergun2012.kd_tree_quality_report import report

    scale = _image_scale(find_scale(request.scale))
    embedded = request.environments == EMBEDDED
    patterns = request.maps or (MAPS[scale.name] if embedded else [])
    sources = study_environments(request, patterns, HEIGHT)
    folder = run_folder(request.output, NAME, request.scale)
    works = [_Work(source, folder) for source in sources]
    own = [work for work in works if work.source.name == IMAGE_MAP]
    shown = own if embedded and own else works[:1]
    groups = [_fit_group(work) for work in works]
    groups += [
        _image_group(work, scene, material, samples, scale)
        for work in shown
        for scene, material in SCENES.get(scale.name, SCENES["standard"])
        for samples in SAMPLES[scale.name]
    ]
    modules = ("experiments.ergun2012.kd_tree_blocks", "experiments.ergun2012.kd_tree_images")
    return run_study(Study(NAME, modules, groups, partial(report)), request, dry_run)


def _image_scale(scale: Scale) -> Scale:
    """Square images of one sub-pixel, with references good enough for PSNR near 50 dB."""
    size = SIZE[scale.name]
    return replace(
        scale, width=size, height=size, subpixels=1, noise_target=NOISE_TARGET[scale.name],
        max_samples=MOST_SAMPLES,
    )  # fmt: skip


def _fit_group(work: _Work) -> Group:
    kinds = [
        *((str(selection), str(selection), "solid-angle") for selection in SELECTIONS),
        (PIXELS, "sse", "pixels"),
    ]
    asked = {
        f"{name}, {blocks} blocks": (name, selection, weighting, blocks)
        for name, selection, weighting in kinds
        for blocks in BLOCKS
    }
    jobs = {
        key: Job(
            {"part": FITS, "environment": work.source.name, "criterion": name, "blocks": blocks},
            {"map": work.source.identity, "sampler": SamplerSpec("kd-tree").identity},
        )
        for key, (name, _, _, blocks) in asked.items()
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        environment = work.load()
        rows: dict[str, Row] = {}
        for key in names:
            name, selection, weighting, blocks = asked[key]
            made = fits.blocks_of(environment, blocks, selection, weighting)
            size = {"width": environment.width, "height": environment.height}
            rows[key] = {**size, **fits.fit_row(environment, made)}
            if blocks == PAPER_BLOCKS and weighting == "solid-angle":
                fits.write_pictures(work.folder, environment, made, name)
        return rows

    return Group(f"blocks of {work.source.name}", jobs, measure)


def _image_group(work: _Work, scene: str, material: str, samples: int, scale: Scale) -> Group:
    where = {
        "part": IMAGES, "environment": work.source.name, "scene": scene, "material": material,
    }  # fmt: skip
    made = images.scene_of(scene, material)
    rounds = ROUNDS[scale.name]
    depends = {
        "map": work.source.identity,
        "samplers": [spec.identity for spec in METHODS.values()],
        "scene": made.digest,
        "scale": repr(scale),
        "rounds": rounds,
    }
    jobs = {
        name: Job({**where, **columns}, depends)
        for name, columns in images.jobs_of(samples).items()
    }

    def tile(name: str) -> Path:
        return image_tile(work.folder, scene, material, samples, name)

    def measure(names: Sequence[str]) -> dict[str, Row]:
        # Times mean something side by side only, so that all are measured again.
        return images.measure(made, work.load(), scale, samples, rounds, work.folder, tile)

    return Group(f"{material} {scene}, {samples} samples", jobs, measure)


def image_tile(folder: Path, scene: str, material: str, samples: int, name: str) -> Path:
    """Where a picture lies from which sheets are made."""
    return folder / "pictures" / f"{scene}_{material}_{samples}_{name.replace(', ', '_')}.png"
