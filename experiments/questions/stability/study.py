"""How samplers hold up numerically: every sampler on maps made to break it, each property a number.

Maps: a textured sky under suns 10⁰ to 10⁹ times as bright; noise over up to nine decades; one texel
or two over the seam, at the poles; constant and black maps; 2 × 1 texels and other small and odd
sizes; denormals, the largest half-float and float32 and its whole range; and a wide map. With
--environments your own maps are tested instead.

Properties: values that are not finite, negative ones, unit length, energy against a sum over all
texels in extended precision, flux that a distribution never draws, the integral of a density over
parts of texels, samples whose density `pdf` does not confirm, chi-square of samples against the
density, bytes that differ between runs on one thread and on four, the same map × 2^k (each light in
turn: angle, irradiance, extent) and × 1000/3 (how far light moves), the map turned by columns (how
far light moves; of a distribution, which share of its probability), and the error of the irradiance
on six plates. 64 lights or samples. What a sampler raises stands in its row.

A second table shows what the shared tables would lose in float32, and why they are float64.

The wide map is 4096 × 2048 at scale quick (below 2 GiB) and 16384 × 8192 at the others, which need
about 16 GB; peak memory is taken on it, as in `light-generation-time`.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.maps.patterns import select
from experiments.maps.sources import EMBEDDED, EnvironmentSource
from experiments.questions.stability.brute_force import accumulate
from experiments.questions.stability.figures import COUNT, ERROR, measure_samplers
from experiments.questions.stability.sections import contrasts, findings_of, matrix, sums
from experiments.run.case import environment_identity
from experiments.run.experiment import Group, Job, Row, RunRequest, Study, experiment
from experiments.run.identity import source_digest
from experiments.run.measure import peak_of
from experiments.run.sampler_spec import SamplerSpec, choose_samplers
from experiments.run.scale import of_scale
from experiments.run.study import study_environments
from samplers import EnvironmentMap
from samplers.conformance.stress_maps import CONTRAST_MAPS, DECADES, STRESS_MAPS, sun_over_sky

WIDE = "wide"
WIDE_HEIGHT = {"quick": 2048, "standard": 8192, "paper": 8192}
WIDE_CONTRAST = 1e5
PRECISIONS = ("float32", "float64")
Source = Callable[[], NDArray]


@experiment("stability")
def stability() -> Study:
    """Every sampler on maps made to break it, each property a number."""
    return Study(
        title="Numerical stability of the samplers",
        sections=(matrix, contrasts, sums),
        findings=findings_of,
        groups=groups,
        sources=("experiments.questions.stability.figures",),
        timed=False,
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per map, and per contrast for the sums."""
    specs = choose_samplers(request.samplers)
    height = of_scale(WIDE_HEIGHT, request.scale)
    found = [
        _map_group(name, load, depends, specs) for name, load, depends in _maps(request, height)
    ]
    if request.environments == EMBEDDED and not request.maps:
        found += [_accumulation_group(decades, height) for decades in DECADES]
    return found


def _maps(request: RunRequest, height: int) -> list[tuple[str, Source, Row]]:
    """Name, radiance and identity of each map."""
    if request.environments != EMBEDDED:
        return [
            (source.name, partial(_radiance, source), {"map": environment_identity(source)})
            for source in study_environments(request, [], 0)
        ]
    depends = {"map": source_digest("samplers.conformance.stress_maps")}
    maps: list[tuple[str, Source, Row]] = [
        (name, make, depends) for name, make in (STRESS_MAPS | CONTRAST_MAPS).items()
    ]
    wide = partial(sun_over_sky, height, WIDE_CONTRAST)
    maps.append((WIDE, wide, {**depends, "height": height}))
    return select(maps, request.maps, "stress map", lambda found: found[0])


def _radiance(source: EnvironmentSource) -> NDArray:
    return source.load().radiance


def _map_group(name: str, load: Source, depends: Row, specs: Sequence[SamplerSpec]) -> Group:
    by_label = {spec.label: spec for spec in specs}
    jobs = {
        label: Job(
            {"table": "samplers", "map": name, "sampler": label},
            {**depends, "sampler": spec.identity},
        )
        for label, spec in by_label.items()
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        radiance = np.ascontiguousarray(load(), np.float32)
        samplers = {label: by_label[label].sampler for label in names}
        found: dict[str, Row] = {
            label: {"height": len(radiance), **row}
            for label, row in measure_samplers(radiance, samplers).items()
        }
        if name == WIDE:
            environment = EnvironmentMap(radiance)
            for label, row in found.items():
                if ERROR not in row:
                    row["peak_mib"] = peak_of(by_label[label], environment, COUNT)
        return found

    return Group(name, jobs, measure)


def _accumulation_group(decades: int, height: int) -> Group:
    jobs = {
        precision: Job(
            {"table": "accumulation", "decades": decades, "precision": precision},
            {"height": height, "map": source_digest("samplers.conformance.stress_maps")},
        )
        for precision in PRECISIONS
    }

    def measure(names: Sequence[str]) -> dict[str, Row]:
        environment = EnvironmentMap(sun_over_sky(height, 10.0**decades))
        result: dict[str, dict[str, Any]] = {
            name: {"height": height, **accumulate(environment, name)} for name in names
        }
        return result

    return Group(f"sums under a sun of 1e{decades}", jobs, measure)
