"""How samplers hold up numerically: every sampler on maps made to break it, each property a number.

Maps: a textured sky under suns 10⁰ to 10⁹ times as bright; noise over up to nine decades; one texel
or two over the seam, at the poles; constant and black maps; 2 × 1 texels and other small and odd
sizes; denormals, the largest half-float and float32 and its whole range; and a wide map. With
--environments your own maps are tested instead.

64 lights or samples; what a sampler raises stands in its row. The report explains the properties.

The wide map is 4096 × 2048 at scale quick (below 2 GiB) and 16384 × 8192 at the others, which need
about 16 GB; peak memory is taken on it, as in `light-generation-time`.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.maps.patterns import select
from experiments.maps.sources import EMBEDDED, EnvironmentSource
from experiments.questions.stability.figures import (
    COUNT,
    ERROR,
    PROPERTIES,
    Property,
    measure_samplers,
)
from experiments.report.figures import line_plot
from experiments.report.parts import Heading, Items, Part, Plot, Table, Text, counted, listed
from experiments.report.style import label_of
from experiments.run.case import environment_identity
from experiments.run.experiment import Group, Row, RunRequest, Study, experiment
from experiments.run.identity import source_digest
from experiments.run.loaded_run import Run
from experiments.run.measure import peak_of
from experiments.run.sampler_spec import SamplerSpec, choose_samplers
from experiments.run.scale import of_scale
from experiments.run.study import study_environments
from samplers import EnvironmentMap
from samplers.conformance.exceptions import EXCEPTIONS
from samplers.conformance.stress_maps import CONTRAST_MAPS, STRESS_MAPS, sun_over_sky

WIDE = "wide"
WIDE_HEIGHT = {"quick": 2048, "standard": 8192, "paper": 8192}
WIDE_CONTRAST = 1e5
DENORMAL = {"nearly-denormal", "denormal", "smallest-blue"}
"""Stress maps whose values, or those of a part of their lights, have few bits."""
Source = Callable[[], NDArray]


@experiment("stability")
def stability() -> Study:
    """Every sampler on maps made to break it, each property a number."""
    return Study(
        title="Numerical stability of the samplers",
        sections=(matrix, contrasts),
        findings=lambda run: findings(_rows(run, "samplers")),
        groups=groups,
        sources=("experiments.questions.stability.figures",),
        timed=False,
    )


def groups(request: RunRequest) -> list[Group]:
    """A group per map."""
    specs = choose_samplers(request.samplers)
    height = of_scale(WIDE_HEIGHT, request.scale)
    return [
        _map_group(name, load, depends, specs) for name, load, depends in _maps(request, height)
    ]


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
    asked = (({"sampler": spec.label}, {"sampler": spec.identity}, spec) for spec in specs)

    def measure(specs: list[SamplerSpec]) -> Iterator[Row]:
        radiance = np.ascontiguousarray(load(), np.float32)
        found = measure_samplers(radiance, {spec.label: spec.sampler for spec in specs})
        environment = EnvironmentMap(radiance)
        for spec in specs:
            row = {"height": len(radiance), **found[spec.label]}
            if name == WIDE and ERROR not in row:
                row["peak_mib"] = peak_of(spec, environment, COUNT)
            yield row

    return Group(name, asked, measure, {"table": "samplers", "map": name}, depends)


CONTRAST_AXIS = "radiance of the sun over that of the sky"
LEAST_SHOWN = 1e-17
"""Where a logarithmic axis puts what is exactly 0."""


def figure_text(value: float) -> str:
    """A figure in as few characters as its size needs."""
    if math.isnan(value):
        return "–"
    if math.isinf(value):
        return "other number"
    if value == 0.0 or (float(value).is_integer() and abs(value) < 1e5):
        return f"{value:.0f}"
    return f"{value:.2f}" if 0.01 <= abs(value) < 100.0 else f"{value:.0e}"


def is_declared(sampler: str, found: Property) -> bool:
    """Whether the conformance suite declares this property an exception of the sampler."""
    return bool(found.check) and found.check in EXCEPTIONS.get(sampler, {})


def _cell(sampler: str, key: str, part: pd.DataFrame) -> str:
    """The worst figure of a sampler's rows; a word where one raised an error."""
    if ERROR in part and part[ERROR].notna().any():
        return "raised"
    found = PROPERTIES[key]
    value = found.worst(part[key].to_numpy(np.float64)) if key in part else math.nan
    declared = found.exceeds(value) and is_declared(sampler, found)
    return figure_text(value) + ("*" if declared else "")


def _rows(run: Run, table: str) -> pd.DataFrame:
    """The rows of one of the two tables, with the columns that it has."""
    return run.rows[run.rows["table"] == table].dropna(axis=1, how="all").reset_index(drop=True)


def matrix(run: Run) -> Iterator[Part]:
    """The worst figure of every sampler by property."""
    rows = _rows(run, "samplers")
    if rows.empty:
        return
    samplers = sorted(rows["sampler"].unique())
    keys = [key for key in PROPERTIES if key in rows]
    titles = [PROPERTIES[key].title for key in keys]
    by_sampler = dict(tuple(rows.groupby("sampler")))
    cells = [[_cell(name, key, by_sampler[name]) for key in keys] for name in samplers]
    text = pd.DataFrame(cells, columns=titles)
    text.insert(0, "sampler", samplers)
    if "peak_mib" in rows:
        peaks = rows.groupby("sampler")["peak_mib"].max()
        text["peak MiB"] = [figure_text(round(float(peaks[name]))) for name in samplers]
    caption = f"Worst of {rows['map'].nunique()} maps, {COUNT} lights or samples."
    yield Table("stability", text, dict.fromkeys(map(str, text), "s"), caption=caption)
    yield from map(Text, _notes(rows))
    beyond = (
        f"{label_of(name)} leaves the tolerance of {PROPERTIES[key].title} on {listed(maps)}."
        for (name, key), maps in _failures(rows).items()
    )
    yield Items((*findings(rows), *beyond))


def _notes(rows: pd.DataFrame) -> list[str]:
    """How the matrix is to be read."""
    tolerances = [
        f"{p.title} {'at least' if p.least else 'at most'} {p.tolerance:g}"
        for p in PROPERTIES.values()
        if p.tolerance is not None
    ]
    notes = [
        "Counts of values not finite, negative values, samples whose density `pdf` does not "
        "confirm, and bytes that differ between runs; length: error of unit directions; × 2^k: "
        "largest change of any light; × 1000/3 and turned: how far light moves, or which share "
        "of a distribution's probability; irradiance: error on six plates. Angles in rad, errors "
        "relative. Tolerances: "
        + ", ".join(tolerances)
        + ". Never drawn: the share of the flux in texels of density 0, which a compensated table "
        "leaves to samples of the BRDF. The integral's error is what exceeds five standard "
        "deviations of the sum over parts of texels. The irradiance error of a distribution is the "
        f"noise of {COUNT} samples. A dash: the property says nothing of this sampler.",
        "Maps of equal or denormal texels have ties; the same ties fall otherwise when rounding "
        "changes, so that × 1000/3 can move lights there, and denormals do not scale exactly, as "
        "their luminance has few bits. The 4096 columns of Cycles' table do not turn with texels "
        "whose number does not divide them. Blocks of the kd-tree whose energies are equal to "
        "rounding change their ranks, and so their shares of its law. LightGen starts at cells of "
        "its copy of the map; those of a map with no more rows than the copy lie on a grid, where "
        "many are as far from one start as from another, and rounding decides.",
    ]
    declared = [
        f"{label_of(name)}, {check}: {reason}"
        for name, checks in EXCEPTIONS.items()
        for check, reason in checks.items()
        if name in set(rows["sampler"])
    ]
    if declared:
        notes.append("\\* Declared exceptions: " + "; ".join(declared) + ".")
    return notes


def findings(rows: pd.DataFrame) -> list[str]:
    """How many samplers leave a tolerance, undeclared, and what was raised."""
    failing, samplers = _failures(rows), counted(rows["sampler"].nunique(), "sampler")
    lit = [one for one, maps in failing.items() if not set(maps) <= DENORMAL]
    dark = len({name for name, _ in failing} - {name for name, _ in lit})
    of = Counter(PROPERTIES[key].title for _, key in lit)
    told = ", ".join(f"{title} of {count}" for title, count in of.items()) or "none"
    found = [f"{dark} of {samplers} leave a tolerance on denormals alone; elsewhere: {told}."]
    if ERROR in rows:
        raised = rows[rows[ERROR].notna()]
        found += [
            f"Raised: {label_of(r['sampler'])} on {r['map']}: {r[ERROR]}"
            for _, r in raised.iterrows()
        ]
    return found


def _failures(rows: pd.DataFrame) -> dict[tuple[str, str], list[str]]:
    failures: dict[tuple[str, str], list[str]] = {}
    for key, found in PROPERTIES.items():
        if key not in rows:
            continue
        for name, where, value in zip(rows["sampler"], rows["map"], rows[key], strict=True):
            if found.exceeds(float(value)) and not is_declared(name, found):
                failures.setdefault((name, key), []).append(where)
    return failures


def contrasts(run: Run) -> Iterator[Part]:
    """Irradiance error and energy error against contrast, a line per sampler."""
    rows = _rows(run, "samplers")
    if rows.empty:
        return
    suns = rows[rows["map"].str.fullmatch(r"sun-1e\d+")]
    if suns["map"].nunique() < 2:
        return
    suns = suns.assign(contrast=suns["map"].str.removeprefix("sun-").astype(float))
    yield Heading("Against contrast")
    for key, heading in (
        ("plate_error", "irradiance error on six plates"),
        ("energy_error", f"energy error (exact: {LEAST_SHOWN:g})"),
    ):
        if key not in suns:
            continue
        shown = suns.dropna(subset=[key]).sort_values(["sampler", "contrast"])
        if key == "plate_error":
            # Where no light is found all is ambient, whose irradiance is the map's own.
            shown = shown[shown[key] > 0.0]
        shown = shown.assign(**{key: shown[key].clip(lower=LEAST_SHOWN)})
        axes = (CONTRAST_AXIS, heading)
        draw = partial(line_plot, shown, "contrast", key, "sampler", axes)
        yield Plot(f"stability_growth_{key}", draw, f"Against contrast: {heading}.")
