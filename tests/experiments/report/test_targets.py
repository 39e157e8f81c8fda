"""What is said of a target."""

import pytest

from experiments.report.targets import MET, target_verdict


@pytest.mark.parametrize(
    ("excess", "words"),
    [
        (0.0, MET),
        (1.0, MET),
        (1.0004, "missed by less than 0.5 %"),
        (1.0049, "missed by less than 0.5 %"),
        (1.0051, "missed by a factor of 1.01"),
        (1.5, "missed by a factor of 1.50"),
    ],
)
def test_a_target_is_met_or_missed_by_what_can_be_seen(excess, words):
    assert target_verdict(excess) == words
