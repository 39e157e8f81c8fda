"""Which sampler for which map, and how many lights: error as a function of what a map shows.

Every method at 4 to 128 lights on many maps, with one seed each: maps, not seeds, are what errors
differ by, and whoever takes a method's lights takes those of one seed. What can be measured on the
map and on the scene stands in every row (`maps/features.py`, `run/scene_features.py`); rays and
seconds do, too. `envlight advice-table` gathers from such rows what `envlight advise` reads.

Meant for photographed maps, by --environments; the embedded ones are the default.
"""

from experiments.questions.advice.sections import (
    features_of_maps,
    features_of_scenes,
    findings,
    what_advice_is_worth,
)
from experiments.report.sections.ranks import ranked
from experiments.run.budget import Budget
from experiments.run.experiment import GridExperiment, experiment
from experiments.run.scale import QUICK, Scale, references_to

QUICK_LIGHTS = (4, 16, 64)
LIGHTS = (4, 8, 16, 32, 64, 128)
REFERENCE_NOISE = {QUICK: 0.004, "medium": 0.005}
"""Of the mean luminance, by scale: a third of the least errors at 128 lights, or less."""


@experiment("which-sampler")
def which_sampler() -> GridExperiment:
    """Which sampler for which map, and how many lights."""
    return GridExperiment(
        title="Which sampler for which map",
        sections=(what_advice_is_worth, features_of_maps, features_of_scenes, ranked()),
        budgets=light_budgets,
        scale=references_to(REFERENCE_NOISE),
        seeds=1,
        quick_scenes=2,
        findings=findings,
    )


def light_budgets(scale: Scale) -> tuple[Budget, ...]:
    """Powers of two, at scale quick every second."""
    return tuple(Budget(count) for count in (QUICK_LIGHTS if scale.name == QUICK else LIGHTS))
