"""Starting an experiment: what is asked for, in which folder, by which executor."""

from contextlib import nullcontext

from experiments.run.executors import make_executor
from experiments.run.experiment import Experiment, Study
from experiments.run.grid import grid_plan
from experiments.run.record import check_run_folder
from experiments.run.request import RunRequest, run_folder
from experiments.run.runner import Finish, Plan, run_plan
from experiments.run.store import DATABASE, Store, store_of
from experiments.run.study import study_plan


def run_experiment(
    experiment: Experiment, request: RunRequest, dry_run: bool, finish: Finish
) -> int:
    """Measure what is missing, then report; returns the exit status: 0, or 1 where some failed."""
    plan: Plan
    if isinstance(experiment, Study):
        plan = study_plan(experiment, request)
    else:
        plan = grid_plan(experiment, request)
    folder = run_folder(request.output, experiment.name, request.scale)
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
            request.executor, request.workers, request.threads, request.cluster, request.host,
            request.tls,
        ) as executor,
    ):  # fmt: skip
        status = run_plan(plan, store, finish, executor, request.timeout)
    return status or int(plan.incomplete)
