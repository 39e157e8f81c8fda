"""Noise of images by the kd-tree and by inversion, at equal samples and at equal time.

Figures 6 and 7 of Ergun, Kurt and Öztürk, "Real-time kd-tree based importance sampling of
environment maps", SCCG 2012: a sphere of three measured materials, and one of extreme anisotropy.

equal samples : as many samples per pixel as inversion by binary search
equal time : the number at which rendering takes as long as inversion does; from a linear cost
    model of short probes, then timed in interleaved rounds with all others
the paper's ratio : four times as many, 32 against 8, which the paper could afford in equal time

One sub-pixel, so that samples are per pixel as in the paper; half of them from the BRDF.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.ergun2012.kd_tree_throughput import BASELINE, METHODS
from experiments.run.bench import Timing, interleaved
from experiments.run.kept_reference import kept_reference
from experiments.run.scale import Scale
from experiments.run.study import Row
from metrics.errors import exposure_scale, psnr, rmse
from renderer.monte_carlo import SampleSplit
from renderer.render import render
from renderer.scene import Camera, Scene
from renderer.scene.ward_materials import MATERIALS
from renderer.scenes import spheres, ward_teapot
from renderer.view import View, make_view
from samplers import EnvironmentMap, LightDistribution
from samplers.threads import for_blocks

SPHERE, TEAPOT = "sphere", "ward-teapot"
EQUAL_SAMPLES, EQUAL_TIME, PAPER_RATIO = "equal samples", "equal time", "the paper's ratio"
RATIO = 4
"""32 samples of the kd-tree against 8 of inversion."""
KD_TREE = "kd-tree"
PROBES = (1, 2, 4)
"""Probed numbers of samples over the baseline's; the cost model is a line through them."""
BLOCK = 1 << 13
SEEDS = 4
LEAST_SAMPLES, MOST_SAMPLES = 2, 1 << 14


def scene_of(name: str, material: str) -> Scene:
    """A lone sphere of a Ward material, as in the paper's figure, or the teapot on its ground."""
    if name == TEAPOT:
        return ward_teapot.scene(MATERIALS[material])
    row = spheres.scene({material: MATERIALS[material]})
    camera = Camera(row.camera.eye, (0.0, 1.0, 0.0), 12.5)
    return replace(row, name=SPHERE, objects=row.objects[1:], camera=camera)


def jobs_of(samples: int) -> dict[str, Row]:
    """What is measured beside inversion at `samples` samples per pixel: columns by row name."""
    rows = [(method, mode) for method in METHODS for mode in (EQUAL_SAMPLES, EQUAL_TIME)]
    rows = [row for row in rows if row != (BASELINE, EQUAL_TIME)] + [(KD_TREE, PAPER_RATIO)]
    return {
        f"{method}, {mode}": {"method": method, "mode": mode, "base_samples": samples}
        for method, mode in rows
    }


@dataclass(frozen=True, eq=False)
class Stage:
    """A view under a map with the lightings that are compared; `count` of them is not used."""

    view: View
    environment: EnvironmentMap
    lighting: dict[str, LightDistribution]

    @classmethod
    def of(cls, scene: Scene, environment: EnvironmentMap, scale: Scale) -> "Stage":
        """The stage of a scene at the scale's size with one sub-pixel."""
        made: dict[str, LightDistribution] = {}
        for method, spec in METHODS.items():
            lighting = spec.sampler.prepare(environment, 1, np.random.default_rng(0))
            assert isinstance(lighting, LightDistribution)
            made[method] = lighting
        return cls(make_view(scene, scale.width, scale.height, 1), environment, made)

    def image(self, method: str, samples: int, seed: int = 0) -> NDArray[np.float32]:
        """The view by so many samples per pixel."""
        lighting = self.lighting[method]
        assert hasattr(lighting, "count")
        counted = replace(lighting, count=samples)  # type: ignore[type-var]
        return render(self.view, counted, self.environment, seed=seed).image

    def generate(self, method: str, samples: int) -> None:
        """Draw the light samples of an image, and look up the densities of the BRDF's."""
        lighting, split = self.lighting[method], SampleSplit.half_and_half(samples)
        points = len(self.view)
        rng = np.random.default_rng(0)
        u = rng.random((BLOCK, 3), np.float32)
        direction, _ = lighting.sample(u)

        def draw(start: int, stop: int) -> None:
            lighting.sample(u[: stop - start])

        def look_up(start: int, stop: int) -> None:
            lighting.pdf(direction[: stop - start])

        for_blocks(draw, points * split.light, BLOCK)
        for_blocks(look_up, points * split.brdf, BLOCK)


def fitted_samples(probes: dict[int, float], seconds: float) -> int:
    """The number of samples that takes `seconds`, by a line through probed (samples, seconds)."""
    counts = np.array(list(probes), np.float64)
    slope, constant = np.polyfit(counts, np.array(list(probes.values())), 1)
    if not slope > 1e-9 * abs(constant):  # times that do not grow tell nothing
        return int(min(probes))
    return int(np.clip(round((seconds - constant) / slope), LEAST_SAMPLES, MOST_SAMPLES))


def measure(
    scene: Scene, environment: EnvironmentMap, scale: Scale, samples: int, rounds: int,
    folder: Path, tile: Callable[[str], Path],
) -> dict[str, Row]:  # fmt: skip
    """All rows of a scene under a map at one number of samples of the baseline.

    tile : where the picture of a row's image goes
    """
    stage = Stage.of(scene, environment, scale)
    counts = _counts(stage, samples, rounds)
    distinct = sorted(set(counts.values()))
    tasks = {f"{m} {n}": partial(stage.image, m, n) for m, n in distinct}
    times = interleaved(
        tasks | {f"draw {m} {n}": partial(stage.generate, m, n) for m, n in distinct}, rounds
    )
    reference = kept_reference(folder, stage.view, environment, scale)
    factor = exposure_scale(reference.image, stage.view.coverage > 0.0)
    truth = reference.image * np.float32(factor)
    _write(tile("reference"), truth)
    rows: dict[str, Row] = {}
    for name, (method, count) in counts.items():
        images = [stage.image(method, count, seed) * np.float32(factor) for seed in range(SEEDS)]
        found = [psnr(image, truth) for image in images]
        rows[name] = {
            "samples": count,
            "psnr": float(np.mean(found)),
            "psnr_spread": float(np.std(found)),
            "rmse": float(np.sqrt(np.mean([rmse(image, truth) ** 2 for image in images]))),
            "noise_floor": reference.noise_floor * factor,
            **times[f"{method} {count}"].columns(),
            "generation_share": _share(times, method, count),
        }
        _write(tile(name), images[0])
        _write(tile(f"{name} difference"), np.float32(5.0) * np.abs(images[0] - truth))
    return rows


def _share(times: dict[str, Timing], method: str, count: int) -> float:
    return times[f"draw {method} {count}"].median / times[f"{method} {count}"].median


def _counts(stage: Stage, samples: int, rounds: int) -> dict[str, tuple[str, int]]:
    """Method and samples of each row; those at equal time from the cost model."""
    probed: Sequence[int] = [max(LEAST_SAMPLES, samples * k) for k in PROBES]
    tasks = {f"{m} {n}": partial(stage.image, m, n) for m in METHODS for n in probed}
    times = interleaved(tasks, max(3, rounds))
    seconds = times[f"{BASELINE} {samples}"].median
    counts = {}
    for name, row in jobs_of(samples).items():
        method = row["method"]
        count = samples
        if row["mode"] == PAPER_RATIO:
            count = RATIO * samples
        elif row["mode"] == EQUAL_TIME:
            probes = {n: times[f"{method} {n}"].median for n in probed}
            count = fitted_samples(probes, seconds)
        counts[name] = (method, count)
    return counts


def _write(path: Path, exposed: NDArray[np.float32]) -> None:
    from experiments.report.light_pattern import enlarged
    from experiments.report.preview import encoded
    from renderer.image import write_png

    write_png(path, enlarged(encoded(exposed)))
