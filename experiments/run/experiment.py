"""What an experiment is.

An experiment over a grid (scene × map × sampler × budget × seed) is data:

    @experiment("table2")
    def table2() -> GridExperiment:
        \"\"\"Which steps of EnvDirects matter.\"\"\"
        return GridExperiment(
            title="Ablation of EnvDirects",
            samplers=configurations,
            sections=(ratios_section,),
        )

The docstring's first line is what `envlight list` prints.

Everything else is shared: options, measurements, the store, resuming after a stop, references,
progress, the report. A `Study` is an experiment whose rows are something else: it says what a row
is and how it is measured.

A section is a function from a finished `Run` to the parts of the report that are its own: see
`experiments.report.parts`. The same sections make the report of a run and, later, that of its
published rows.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import combinations
from pathlib import Path
from typing import Any

from experiments.maps.classes import representatives
from experiments.maps.sources import EMBEDDED, find_environments
from experiments.run.budget import WRITTEN, Budget
from experiments.run.case import choose_scenes
from experiments.run.executors import SERIAL
from experiments.run.identity import library_versions, programs
from experiments.run.loaded_run import Run
from experiments.run.machine import machine_identity
from experiments.run.measurement import STOCHASTIC_SEEDS, Grid
from experiments.run.registry import experiment as experiment
from experiments.run.sampler_spec import SamplerSpec, choose_samplers
from experiments.run.scale import QUICK, Scale, find_scale, of_scale
from samplers import EnvlightError, sampler_names

ALWAYS_USED = ("experiment", "scale", "output", "images", "threads", "store")
"""Fields of a request that no experiment can leave alone."""
WRITTEN_AS = {"budgets": "--budget", "as_json": "--json"}
"""How options are written that are not called as their fields are."""


@dataclass(frozen=True)
class RunRequest:
    """The options of `envlight run`."""

    experiment: str
    scale: str = QUICK
    environments: str = EMBEDDED
    maps: list[str] = field(default_factory=list)
    scenes: list[str] = field(default_factory=list)
    samplers: list[str] = field(default_factory=list)
    budgets: list[str] = field(default_factory=list)
    output: Path | None = None
    repair: bool = False
    images: bool = True
    threads: int = 0
    as_json: bool = False
    executor: str = SERIAL
    workers: int = 0
    cluster: str = ""
    strict: bool = False
    reference_noise: float = 0.0
    seeds: int = 0
    timeout: float = 0.0
    store: Path | None = None

    @property
    def folder(self) -> Path:
        """Of the run: the one asked for, or runs/EXPERIMENT-SCALE."""
        return self.output or Path("runs") / f"{self.experiment}-{self.scale}"

    def budget(self, default: Budget) -> Budget:
        """The budget of an experiment that takes one of a kind; EnvlightError for others."""
        budgets = [Budget.parse(text) for text in self.budgets] or [default]
        if len(budgets) > 1 or budgets[0].kind != default.kind:
            told = ", ".join(self.budgets)
            raise EnvlightError(f"--budget {told}: one of {WRITTEN[default.kind]} here")
        return budgets[0]


class WatchedRequest(RunRequest):
    """A request that knows which of its options were read: what was not had no effect."""

    def __init__(self, request: RunRequest) -> None:
        super().__init__(**vars(request))
        vars(self)["_read"] = set()

    def __getattribute__(self, name: str) -> Any:
        if name in RunRequest.__dataclass_fields__:
            vars(self)["_read"].add(name)
        return super().__getattribute__(name)

    def unread(self) -> list[str]:
        """The options that were given and not read, as they are written."""
        given = vars(self)
        return [
            WRITTEN_AS.get(one.name, f"--{one.name.replace('_', '-')}")
            for one in fields(RunRequest)
            if one.name not in (*ALWAYS_USED, *given["_read"])
            and given[one.name] not in ([], one.default)
        ]


TEST_SCENES = ("rubiks-cube", "vase", "teapot", "birdcage")
Row = dict[str, Any]
Section = Callable[[Run], Iterable[Any]]
ANSWERS = ("yes", "in part", "no", "shown")
"""How a verdict begins; shown where a paper claims nothing of a picture."""


@dataclass(frozen=True)
class Published:
    """What a paper printed of its own methods, measured on other scenes, maps and budgets.

    source : as tables name it, e.g. "Wu 2025, Table 1"
    values : by the samplers' labels here, then by the metric's name: the value, and its mean rank
        (NaN where none is printed)
    """

    source: str
    values: dict[str, dict[str, tuple[float, float]]]

    @property
    def paper(self) -> str:
        """The source without what is said of its figures."""
        return self.source.partition(" (")[0].partition(",")[0]

    def ordered_alike(self, metric: str, here: Mapping[Any, float]) -> tuple[int, int]:
        """How many pairs of methods have the paper's order here, and how many it tells apart.

        here : a value of each method that is here, by its label
        """
        found = {name: value for name, value in here.items() if not math.isnan(value)}
        printed = {name: its[metric][0] for name, its in self.values.items() if name in found}
        pairs = [(a, b) for a, b in combinations(printed, 2) if printed[a] != printed[b]]
        alike = [(printed[a] < printed[b]) == (here[a] < here[b]) for a, b in pairs]
        return sum(alike), len(pairs)


UNTOLD = "not told"
"""The verdict where there is none."""


@dataclass(frozen=True)
class PaperFigure:
    """A table or figure of a paper that an experiment makes.

    number : as its paper has it, such as "Fig. 8"
    shows : what there is to see, in a few words
    verdict : from a run, whether the paper's claim comes out, in about five words that begin with
        one of `ANSWERS`, and a sentence why
    """

    number: str
    shows: str
    verdict: Callable[[Run], tuple[str, str]]

    def told(self, run: Run) -> tuple[str, str]:
        """The verdict, and why; there is none where the run lacks what the claim compares."""
        try:
            return self.verdict(run)
        except (KeyError, IndexError, ValueError):
            return UNTOLD, "Methods that the paper compares are not in this run."


def answer(holds: int, of: int) -> str:
    """Say yes where all hold that were asked, no where none does."""
    return "yes" if of and holds == of else "in part" if holds else "no"


def all_samplers() -> tuple[SamplerSpec, ...]:
    """Every registered method with the paper's parameters."""
    named = map(SamplerSpec, sampler_names())
    return tuple(spec for spec in named if spec.sampler.in_all_tables)


def budgets_of(counts: Mapping[str, Sequence[int]]) -> Callable[[Scale], tuple[Budget, ...]]:
    """So many lights, by the names of scales."""
    return lambda scale: tuple(map(Budget, of_scale(counts, scale.name)))


@dataclass(frozen=True, kw_only=True)
class GridExperiment:
    """An experiment over a grid.

    title : heading of its report
    sections : what its report holds, in order
    scenes, maps, samplers, budgets : what runs without --scenes, --maps, --samplers and --budget;
        of the embedded maps, where there is none all; samplers and budgets in display order
    also : further pairs of sampler and budget, unless --budget is given
    scale : what it changes of the scale that was asked for, such as how fine references are
    seeds : of a stochastic sampler in each case
    quick_scenes : at scale quick only the first so many of the scenes, None for all
    quick_maps : at scale quick only the first so many embedded maps of every kind, None for all
    quick_named : embedded maps that it has besides
    published : the paper's figures that stand beside ours
    findings : sentences on a run for the page of all published ones; None for who is first
    figures : the paper's tables and figures that it makes
    opening : what that page begins with, of the largest images; its reports have no ranking first
    name, summary : given by `experiment`
    """

    title: str
    sections: Sequence[Section]
    scenes: tuple[str, ...] = TEST_SCENES
    maps: tuple[str, ...] = ()
    samplers: Callable[[], tuple[SamplerSpec, ...]] = all_samplers
    budgets: Callable[[Scale], tuple[Budget, ...]] = lambda scale: tuple(map(Budget, scale.budgets))
    also: Callable[[Scale], tuple[tuple[SamplerSpec, Budget], ...]] = lambda scale: ()
    scale: Callable[[Scale], Scale] = lambda scale: scale
    seeds: int = STOCHASTIC_SEEDS
    quick_scenes: int | None = None
    quick_maps: int | None = None
    quick_named: tuple[str, ...] = ()
    published: Published | None = None
    findings: Callable[[Run], Sequence[str]] | None = None
    figures: tuple[PaperFigure, ...] = ()
    opening: Section | None = None
    name: str = ""
    summary: str = ""

    def grid(self, request: RunRequest) -> Grid:
        """What is to be compared; EnvlightError for any name that does not exist."""
        scale = self.scale(find_scale(request.scale))
        if request.reference_noise:
            scale = scale.with_noise(request.reference_noise)
        quick = scale.name == QUICK
        scenes = self.scenes[: self.quick_scenes] if quick else self.scenes
        maps = request.maps
        if not maps and request.environments == EMBEDDED:
            maps = list(self.maps)
            if quick and self.quick_maps:
                maps = [*representatives(self.quick_maps), *self.quick_named]
        own = self.samplers()
        samplers = choose_samplers(request.samplers, own) if request.samplers else own
        also = () if request.budgets else self.also(scale)
        grid = Grid(
            choose_scenes(request.scenes or list(scenes)),
            tuple(find_environments(request.environments, maps, scale.map_height, request.repair)),
            samplers,
            tuple(dict.fromkeys(map(Budget.parse, request.budgets))) or self.budgets(scale),
            scale,
            request.seeds or self.seeds,
            tuple(one for one in also if not request.samplers or one[0] in samplers),
        )
        if not grid.measurements():
            raise EnvlightError(f"nothing is left to run: {'; '.join(grid.left_out())}")
        return grid


@dataclass(frozen=True, eq=False)
class Group:
    """Rows that are measured side by side, such as all methods on one map.

    label : what is printed while it is measured
    asked : of each row its own parameters, which stand in it, what else determines it, such as the
        source of a sampler, and the work that it is
    measure : from the works of the rows that are missing to their results, in that order
    columns, depends : parameters, and what else determines the rows, that all have alike
    """

    label: str
    asked: Iterable[tuple[Row, Row, Any]]
    measure: Callable[[list[Any]], Iterable[Row]]
    columns: Row = field(default_factory=dict)
    depends: Row = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Study:
    """An experiment whose rows are not those of a grid.

    title : heading of its report
    sections : what its report holds, in order
    groups : what is measured; it reads at once all options that it uses, the others are refused
    sources : modules whose source, with all that it imports, determines the results
    timed : whether results depend on the machine
    findings : sentences on a run for the page of all published ones
    figures : the paper's tables and figures that it makes
    name, summary : given by `experiment`
    """

    title: str
    sections: Sequence[Section]
    groups: Callable[[RunRequest], list[Group]]
    sources: tuple[str, ...]
    timed: bool = True
    findings: Callable[[Run], Sequence[str]] | None = None
    figures: tuple[PaperFigure, ...] = ()
    name: str = ""
    summary: str = ""

    def identity(self, columns: Row, depends_on: Row) -> Row:
        """All that determines a row, of these parameters, which depends on something else, too."""
        return {
            "experiment": self.name,
            "parameters": columns,
            "depends_on": depends_on,
            "programs": programs(*self.sources),
            "libraries": library_versions(*self.sources),
            "machine": machine_identity() if self.timed else {},
        }


Experiment = GridExperiment | Study


def findings_of(experiment: Experiment, run: Run) -> tuple[str, ...]:
    """What an experiment finds in a run, in sentences; its verdicts where it has no other words."""
    if experiment.findings is not None:
        return tuple(experiment.findings(run))
    verdicts = ((one.number, one.told(run)) for one in experiment.figures)
    return tuple(f"{number}: {'. '.join(told)}" for number, told in verdicts if told[0] != UNTOLD)
