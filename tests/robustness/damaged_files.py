"""Files damaged in thousands of ways: each is read, or refused by one sentence, and nothing else.

Readers run in a guarded process: a crash of a C++ library, an endless loop or a demand for all
memory is counted instead of ending the campaign.
"""

import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from samplers import EnvironmentMap
from tests.robustness.guarded import Guard
from tests.robustness.mutation import mutate
from tests.robustness.sample_files import write_samples
from tests.robustness.tally import FAULTS, NotFinite, Tally

SEED = 0
SUFFIXES = (".exr", ".hdr", ".ply", ".obj", ".glb", ".toml")


def read(path: str) -> str:
    """Read a file by what its suffix promises; says how large the result is.

    Raises NotFinite for a result that holds NaN or infinity."""
    file = Path(path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of triangles that were left out
        if file.suffix in (".exr", ".hdr"):
            environment = EnvironmentMap.from_file(file, repair=True)
            _require_finite(environment.radiance)
            return f"{environment.radiance.shape}"
        if file.suffix == ".toml":
            from renderer.scene.scene_file import read_scene

            scene = read_scene(file)
            _require_finite(*(part.mesh.vertex for part in scene.objects))
            return f"{len(scene.objects)} objects"
        from renderer.scene.mesh_file import read_shape

        shape = read_shape(file)
        _require_finite(shape.vertex)
        return f"{len(shape.triangle)} triangles"


def _require_finite(*arrays: np.ndarray) -> None:
    if not all(np.isfinite(array).all() for array in arrays):
        raise NotFinite("NaN or infinity in a result")


def damaged(samples: list[Path], count: int, seed: int = SEED) -> Iterator[tuple[Path, bytes]]:
    """`count` damaged contents with the sample that each was made from, formats taking turns.

    Each depends on the seed and its number alone."""
    contents = {sample: sample.read_bytes() for sample in samples}
    formats = [[s for s in samples if s.suffix == suffix] for suffix in SUFFIXES]
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        choice = formats[number % len(formats)]
        one, other = choice[int(rng.integers(len(choice)))], samples[rng.integers(len(samples))]
        yield one, mutate(contents[one], contents[other], rng)


def run_campaign(
    folder: Path, count: int, seed: int = SEED, told: Callable[[int], None] = lambda number: None
) -> Tally:
    """Read `count` damaged files; those that broke a reader stay in folder/faults.

    told : called with the number of each file that is done"""
    samples = write_samples(folder)
    tally = Tally()
    with Guard(read) as guard:
        for number, (sample, content) in enumerate(damaged(samples, count, seed)):
            path = folder / f"damaged{sample.suffix}"
            path.write_bytes(content)
            kind = tally.add(number, sample.suffix[1:], sample.name, guard.call(str(path)))
            if kind in FAULTS:
                kept = folder / "faults" / f"{seed}-{number}{sample.suffix}"
                kept.parent.mkdir(exist_ok=True)
                kept.write_bytes(content)
            told(number)
        tally.slowest, tally.peak_bytes = guard.slowest, guard.peak_bytes
    return tally
