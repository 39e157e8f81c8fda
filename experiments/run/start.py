"""Starting an experiment: what is asked for, in which folder, by which executor."""

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager, nullcontext

from experiments.run.executors import DASK, KINDS, PROCESSES, SERIAL, ProcessExecutor, shared_out
from experiments.run.experiment import Experiment, RunRequest, Study
from experiments.run.grid import grid_plan
from experiments.run.loaded_run import check_run_folder
from experiments.run.runner import Finish, Plan, run_plan
from experiments.run.store import DATABASE, Store, store_of
from experiments.run.study import study_plan
from samplers import EnvlightError


def run_experiment(
    experiment: Experiment, request: RunRequest, dry_run: bool, finish: Finish
) -> int:
    """Measure what is missing, then report; returns the exit status: 0, or 1 where some failed."""
    plan: Plan
    if isinstance(experiment, Study):
        plan = study_plan(experiment, request)
    else:
        plan = grid_plan(experiment, request)
    folder = request.folder
    check_run_folder(folder, experiment.name, request.scale)
    if dry_run:
        place = request.store or store_of(folder)
        there = (place / DATABASE).is_file()
        with Store.reading(folder, place) if there else nullcontext() as store:
            plan.tell(store, request, folder)
        return 0
    with (
        Store.writing(folder, request.store) as store,
        make_executor(
            request.executor, request.workers, request.threads, request.cluster
        ) as executor,
    ):
        status = run_plan(plan, store, finish, executor, request.timeout)
    return status or int(plan.incomplete)


@contextmanager
def make_executor(
    kind: str = SERIAL, workers: int = 0, threads: int = 0, cluster: str = ""
) -> Iterator[Executor | None]:
    """The executor of a run; None for work in this process alone.

    workers : how many measurements are worked on at once; 0 for as many as cores
    threads : of the kernels in each process or local worker; 0 for all cores, shared among them
    cluster : address or scheduler file of a Dask scheduler, whose workers have threads of their own

    Raises EnvlightError for what does not go together.
    """
    if kind not in KINDS:
        raise EnvlightError(f"no executor is called '{kind}'; use {', '.join(KINDS)}")
    if cluster and kind != DASK:
        raise EnvlightError(f"--cluster goes with --executor {DASK} only")
    if workers and (kind == SERIAL or cluster):
        how = "the scheduler's workers are used" if cluster else "it works on one at a time"
        raise EnvlightError(f"--workers does not go with this executor: {how}")
    workers, threads = shared_out(workers, threads)
    if kind == SERIAL:
        yield None
    elif kind == PROCESSES:
        with ProcessExecutor(workers, threads) as processes:
            yield processes
    else:
        from experiments.run.cluster_executor import cluster_executor

        with cluster_executor(cluster, workers, threads) as executor:
            yield executor
