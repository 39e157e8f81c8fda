"""What `envlight list`, `run` and `show` do."""

from dataclasses import dataclass
from pathlib import Path

from experiments.run.budget import Budget
from experiments.run.catalogue import description, experiment_names, find_experiment
from experiments.run.executors import SERIAL
from experiments.run.scale import SCALES
from experiments.run.store import Store
from experiments.run.study import show_study
from samplers import EnvlightError, sampler_class, sampler_names
from samplers.threads import set_thread_count


def list_names(kind: str) -> None:
    """Print the names of one kind, or of all."""
    from experiments.maps import places as embedded
    from renderer import scenes

    kinds = {
        "samplers": [f"{name:24} {_headline(name)}" for name in sampler_names()],
        "scenes": scenes.names(),
        "environments": [f"{name:24} {embedded.kind(name)}" for name in embedded.names()],
        "scales": [
            f"{s.name:24} {s.width}×{s.height}, {s.subpixels} sub-pixels" for s in SCALES.values()
        ],
        "experiments": [f"{name:24} {description(name)}" for name in experiment_names()],
    }
    if kind not in ("all", *kinds):
        raise EnvlightError(f"nothing is called '{kind}'; list {', '.join(kinds)}, or all")
    for heading, names in kinds.items():
        if kind in ("all", heading):
            print(f"{heading}:")
            for name in names:
                print(f"  {name}")


def _headline(name: str) -> str:
    return (sampler_class(name).__doc__ or "").strip().splitlines()[0]


@dataclass(frozen=True)
class RunRequest:
    """The options of `envlight run`.

    tabulate : measure nothing; make the tables and plots of the stored rows again
    """

    experiment: str
    scale: str
    environments: str
    maps: list[str]
    scenes: list[str]
    samplers: list[str]
    budgets: list[str]
    output: Path | None
    repair: bool
    images: bool
    threads: int
    as_json: bool = False
    executor: str = SERIAL
    workers: int = 0
    cluster: str = ""
    tabulate: bool = False

    def lights(self, default: int) -> int:
        """The number of lights of an experiment that takes one: the first budget's."""
        return Budget.parse(self.budgets[0]).lights if self.budgets else default


def run(request: RunRequest, dry_run: bool) -> int:
    """Run an experiment; returns the exit status: 0, or 1 where some of it failed."""
    if request.threads:
        set_thread_count(request.threads)
    experiment = find_experiment(request.experiment)
    if request.executor != SERIAL and not hasattr(experiment, "EXPERIMENT"):
        raise EnvlightError(
            f"experiment '{request.experiment}': it runs in one process; leave out --executor"
        )
    status: int = experiment.run(request, dry_run)
    return status


def show(folder: Path, why: list[str], as_json: bool = False) -> None:
    """Print what a run folder holds; by keys, what determines a measurement or tells two apart."""
    from experiments.report.tables import as_text, print_summary, rows_of
    from experiments.run.explain import explain
    from experiments.run.summary import summary

    with Store.reading(folder) as store:
        if why:
            print(explain(store, why))
            return
        everything = store.rows()
        if any("experiment" in identity for _, identity, _ in everything):
            show_study(store)
            return
        plan = store.plan()
        rows = rows_of(store, plan)
        if as_json:
            counts = {"finished": len(rows), "planned": len(plan)}
            print(as_text(summary(rows) if len(rows) else rows, counts))
            return
        print(
            f"{folder}: {len(rows)} of {len(plan)} measurements of the newest start are finished; "
            f"{len(everything) - len(rows)} measurements of other plans; "
            f"{len(store.sessions())} starts"
        )
        for (scale, scene), part in rows.groupby(["scale", "scene"]) if len(rows) else ():
            print(
                f"  {scale} · {scene}: {len(part)} measurements, "
                f"{part['environment'].nunique()} maps"
            )
        if len(rows):
            print_summary(summary(rows), folder.name)
