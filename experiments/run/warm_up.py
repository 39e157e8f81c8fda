"""Compiling side by side: kernels that this machine has never compiled are, by all cores at once.

Numba compiles one function at a time in a process, mostly in Python, and keeps the machine code in
a folder that processes share. Where a run finds nothing there of the kernels that it needs, pieces
of work, tiny and of every kind, are done in several processes before it begins. Two that need the
same kernel at the same time both compile it; so what most others build on stands first, and
rendering comes last.
"""

from collections.abc import Iterable
from concurrent.futures import Executor
from contextlib import ExitStack, suppress
from pathlib import Path

import numpy as np

from experiments.progress import telling
from experiments.run.executors import Job, ProcessExecutor, run_jobs
from experiments.run.identity import digest, library_versions, source_digest
from experiments.run.judging import scores
from experiments.run.measure import guarded
from experiments.run.rendering import rehearse, rehearse_lights, rehearse_reference
from experiments.run.sampler_spec import SamplerSpec
from metrics.registry import metrics
from metrics.truth import Truth
from samplers import kernel_cache
from samplers.threads import core_count

LEAST_SAMPLERS = 4
"""With fewer, processes take longer to start than they save."""
MOST_PROCESSES = 4
"""More would mostly compile what another compiles, too, in almost a gigabyte each."""


def warm_up(
    samplers: Iterable[SamplerSpec], executor: Executor | None, timeout: float = 0.0
) -> None:
    """Compile what samplers, references and metrics need, where this was not done before.

    executor : of the run; its processes do it where it has some, otherwise processes of their own
    timeout : seconds that a sampler may take, 0 for as long as it needs

    What fails is left to the run.
    """
    cores = core_count()
    notes = {one: _note(one) for one in dict.fromkeys(samplers)}
    fresh = [one for one, note in notes.items() if note is not None and not note.is_file()]
    if cores < 2 or len(fresh) < LEAST_SAMPLERS:
        return
    own = min(cores, MOST_PROCESSES)
    with ExitStack() as stack:
        if not isinstance(executor, ProcessExecutor):
            executor = stack.enter_context(ProcessExecutor(own, threads=1))
        _compile(fresh, executor, timeout)
    with suppress(OSError):
        for note in filter(None, notes.values()):
            note.parent.mkdir(parents=True, exist_ok=True)
            note.touch()


def _note(sampler: SamplerSpec) -> Path | None:
    """The file that says that this was done; None where kernels cannot be kept."""
    folder = kernel_cache.folder()
    if folder is None:
        return None
    modules = "renderer.reference", "renderer.render", *(metric.module for metric in metrics())
    needed = [source_digest(*modules), library_versions(*modules), sampler.identity]
    return folder / f"warm-{digest(needed)}"


def _compile(samplers: list[SamplerSpec], executor: Executor, timeout: float) -> None:
    """Have everything done once on the executor, what others build on first."""
    with telling("compiling, once on this machine", len(samplers)) as told:
        tasks = [(one, timeout) for one in samplers]
        lights = [Job(_lights, one, lambda future: told.advance()) for one in tasks]
        first = [Job(work, None, lambda future: None) for work in (_reference, _judging)]
        run_jobs(executor, ([job] for job in (*first, *lights)))
        run_jobs(executor, ([Job(_rendering, one, lambda future: None)] for one in tasks))


def _reference(_: None) -> None:
    rehearse_reference()


def _judging(_: None) -> None:
    image = np.random.default_rng(0).random((12, 16, 3), np.float32)
    truth = Truth(image, 1.0, 0.1, (image, image))
    scores(image[::-1], truth, [metric.name for metric in metrics()])


def _lights(task: tuple[SamplerSpec, float]) -> None:
    sampler, timeout = task
    guarded(timeout, rehearse_lights, sampler)


def _rendering(task: tuple[SamplerSpec, float]) -> None:
    sampler, timeout = task
    guarded(timeout, rehearse, sampler)
