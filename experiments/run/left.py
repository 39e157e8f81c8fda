"""What a start of a grid would still do: all that neither its own folder holds nor one beside it.

Only whole rows count as there. Nothing is written.
"""

from collections.abc import Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from experiments.run.case import Case
from experiments.run.kept_images import image_path, reference_path
from experiments.run.measurement import Measurement
from experiments.run.runner import missing_measurements, planned
from experiments.run.shared_results import run_folders
from experiments.run.store import DATABASE, Store
from samplers import EnvlightError


@dataclass(frozen=True)
class Left:
    """What is still to be made.

    measurements : in their order; references : how many of their cases have none
    """

    measurements: list[Measurement]
    references: int


def left_to_do(measurements: Sequence[Measurement], folder: Path, images: bool) -> Left:
    """What is missing of the measurements of a run in `folder`, where nothing need be yet.

    images : whether images are kept, so that a row beside is of use with its image alone

    Raises StoreError where the folder's own results cannot be read.
    """
    with ExitStack() as stack:
        own = [stack.enter_context(Store.reading(folder))] if _is_run(folder) else []
        beside: list[Store] = []
        for other in run_folders(folder.parent, folder):
            with suppress(EnvlightError):  # such a folder is of no use
                store = stack.enter_context(Store.reading(other))
                store.sessions()  # cannot be read where the file is damaged
                beside.append(store)

        @cache
        def has_reference(case: Case) -> bool:
            return any(_has_reference(store, case) for store in (*own, *beside))

        def can_be_taken(one: Measurement) -> bool:
            return (
                not one.budget.timed
                and has_reference(one.case)
                and any(_has_row(store, one, images) for store in beside)
            )

        missing = missing_measurements(own[0], measurements) if own else measurements
        left = [one for one in missing if not can_be_taken(one)]
        cases = {one.case for one in left}
        return Left(left, sum(not has_reference(case) for case in cases))


def _is_run(folder: Path) -> bool:
    return (folder / DATABASE).is_file()


def _has_reference(store: Store, case: Case) -> bool:
    row = store.get("reference", case.reference_key)
    return row is not None and reference_path(store.folder, case).is_file()


def _has_row(store: Store, one: Measurement, images: bool) -> bool:
    whole = store.measured(planned(one)) is not None
    return whole and (not images or image_path(store.folder, one).is_file())
