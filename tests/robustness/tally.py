"""What a campaign of many guarded calls saw, counted."""

from dataclasses import dataclass, field

import pandas as pd

from tests.robustness.guarded import CRASH, FINE, HANG, MEMORY, REFUSED, TRACEBACK, Verdict

NAN = "nan"
FAULTS = (TRACEBACK, CRASH, HANG, MEMORY, NAN)
KINDS = (FINE, REFUSED, *FAULTS)


class NotFinite(Exception):
    """A result holds NaN or infinity."""


@dataclass
class Tally:
    """Verdicts of a campaign.

    counts : by group, such as a file format or a sampler, and kind
    faults : number, group, what was tried and what happened
    slowest : seconds of the slowest call; peak_bytes : of resident memory of any process"""

    counts: dict[str, dict[str, int]] = field(default_factory=dict)
    faults: list[tuple[int, str, str, str]] = field(default_factory=list)
    slowest: float = 0.0
    peak_bytes: int = 0

    def add(self, number: int, group: str, what: str, verdict: Verdict) -> str:
        """Count a verdict; returns its kind."""
        not_finite = verdict.text.startswith(f"{NotFinite.__name__}:")
        kind = NAN if verdict.kind == TRACEBACK and not_finite else verdict.kind
        of_group = self.counts.setdefault(group, dict.fromkeys(KINDS, 0))
        of_group[kind] += 1
        if kind in FAULTS:
            self.faults.append((number, group, what, f"{kind}: {verdict.text}"))
        return kind

    def table(self) -> pd.DataFrame:
        """One line per group and one of all, with the number of calls."""
        table = pd.DataFrame.from_dict(self.counts, orient="index", columns=list(KINDS))
        table = table.sort_index()
        table.loc["all"] = table.sum()
        table.insert(0, "tried", table.sum(axis="columns"))
        return table.rename_axis("group").reset_index()

    def tell(self) -> int:
        """Print what broke, the slowest call and the largest process; returns how many faults."""
        for number, group, what, text in self.faults:
            print(f"number {number}, {group}, {what}: {text}")
        print(
            f"the slowest took {self.slowest:.1f} s; no process held more than "
            f"{self.peak_bytes / 2**30:.2f} GiB"
        )
        return len(self.faults)
