"""What the renderer's speed is meant to reach beside its peers, and whether it does."""

from dataclasses import dataclass

import pandas as pd

from experiments.questions.renderer_throughput.tasks import (
    BARE,
    EMBREEX,
    IMAGE_GLOBAL,
    IMAGE_MIS,
    KERNEL,
    OWN,
    SAMPLED,
    VIEW,
)

THREADS = 2
SCALING_MARGIN = 0.05
"""How much less than Embree's own scaling still counts as the same."""
TARGET_FORMATS = {"scene": "s", "target": "s", "wanted": ".2f", "reached": ".2f", "verdict": "s"}


@dataclass(frozen=True)
class Target:
    """The renderer's speed at a kind of work is to be `wanted` times that of another method."""

    work: str
    method: str
    wanted: float


TARGETS = (
    Target(KERNEL, EMBREEX, 2.0),
    Target(IMAGE_MIS, "Mitsuba llvm_ad_rgb", 1.5),
    Target(IMAGE_MIS, "Mitsuba scalar_rgb", 4.0),
    Target(IMAGE_GLOBAL, "Mitsuba llvm_ad_rgb", 2.0),
)


def against_targets(rows: pd.DataFrame) -> pd.DataFrame:
    """Each target for which there are times: what is wanted, what is reached, and the verdict."""
    found: list[dict[str, object]] = []
    for scene, part in rows.groupby("scene", sort=False):
        seconds = part.set_index(["work", "method", "threads"])["seconds"].to_dict()
        for target in TARGETS:
            own = seconds.get((target.work, OWN, THREADS))
            other = seconds.get((target.work, target.method, THREADS))
            if own and other:
                name = f"{target.work}: speed over {target.method}"
                found.append(_row(scene, name, target.wanted, other / own, _why(seconds, target)))
        for work in (KERNEL, SAMPLED):
            bare, own = (_scaling(seconds, work, method) for method in (BARE, OWN))
            if bare and own:
                name = f"{work}: {THREADS} threads over 1, as bare Embree"
                found.append(_row(scene, name, bare - SCALING_MARGIN, own, ""))
    return pd.DataFrame(found)


def _row(scene: object, target: str, wanted: float, reached: float, why: str) -> dict[str, object]:
    verdict = "met" if reached >= wanted else f"missed by a factor of {wanted / reached:.2f}{why}"
    return {
        "scene": scene, "target": target, "wanted": wanted, "reached": reached, "verdict": verdict,
    }  # fmt: skip


def _scaling(seconds: dict, work: str, method: str) -> float | None:
    one, more = seconds.get((work, method, 1)), seconds.get((work, method, THREADS))
    return one / more if one and more else None


def _why(seconds: dict, target: Target) -> str:
    """Where the renderer's time goes: what Embree alone takes of it on the same rays."""
    work = {IMAGE_MIS: SAMPLED, IMAGE_GLOBAL: KERNEL}.get(target.work, target.work)
    own, bare = seconds.get((target.work, OWN, THREADS)), seconds.get((work, BARE, THREADS))
    if not (own and bare):
        return ""
    parts = [f"Embree alone takes {100 * bare / own:.0f} % of its time on the same shadow rays"]
    view = seconds.get((VIEW, OWN, THREADS))
    if work != target.work and view:
        parts.append(f"the view {100 * view / own:.0f} %")
    return ": " + ", ".join(parts)
