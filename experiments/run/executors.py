"""Executors by name: in this process, in several, or on a Dask cluster."""

import os
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path

from samplers import EnvlightError

SERIAL, PROCESSES, DASK = KINDS = "serial", "processes", "dask"


@contextmanager
def make_executor(
    kind: str = SERIAL, workers: int = 0, threads: int = 0, cluster: str = "",
    host: str = "", tls: Path | None = None,
) -> Iterator[Executor | None]:  # fmt: skip
    """The executor of a run; None for work in this process alone.

    workers : how many measurements are worked on at once; 0 for as many as cores
    threads : of the kernels in each process or local worker; 0 for all cores, shared among them
    cluster : address or scheduler file of a Dask scheduler, whose workers have threads of their own
    host : where a Dask cluster of this machine listens; empty for this machine alone
    tls : a folder with the certificates by which parts of a Dask cluster know each other

    Raises EnvlightError for what does not go together.
    """
    if kind not in KINDS:
        raise EnvlightError(f"no executor is called '{kind}'; use {', '.join(KINDS)}")
    if cluster and kind != DASK:
        raise EnvlightError(f"--cluster goes with --executor {DASK} only")
    if (host or tls) and kind != DASK:
        raise EnvlightError(f"--host and --tls go with --executor {DASK} only")
    if host and cluster:
        raise EnvlightError("--host does not go with --cluster: its scheduler listens already")
    if workers and (kind == SERIAL or cluster):
        how = (
            "the scheduler's workers are used"
            if cluster
            else "it works on one measurement at a time"
        )
        raise EnvlightError(f"--workers does not go with this executor: {how}")
    workers, threads = shared_out(workers, threads)
    if kind == SERIAL:
        yield None
    elif kind == PROCESSES:
        from experiments.run.process_executor import ProcessExecutor

        with ProcessExecutor(workers, threads) as processes:
            yield processes
    else:
        from experiments.run.cluster_executor import cluster_executor

        with cluster_executor(cluster, workers, threads, host, tls) as executor:
            yield executor


def shared_out(workers: int, threads: int) -> tuple[int, int]:
    """How many workers share out this machine, and the threads of each; 0 is for what it has."""
    cores = os.cpu_count() or 1
    workers = workers or cores
    return workers, threads or max(1, cores // workers)


def undisturbed(workers: int, threads: int) -> int:
    """How many workers of so many threads have cores of their own; more wait for one another."""
    return min(workers, max(1, (os.cpu_count() or 1) // threads))
