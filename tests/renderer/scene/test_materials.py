"""Materials refuse what no surface does, and store plain numbers."""

import numpy as np
import pytest

from renderer.scene.materials import Coated, Conductor, Lambert, Ward
from samplers.errors import EnvlightError

GRAY = (0.5, 0.5, 0.5)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Lambert((0.5, 0.5, 1.1)),
        lambda: Lambert((0.5, float("nan"), 0.5)),
        lambda: Lambert((-0.1, 0.5, 0.5)),
        lambda: Lambert((0.5, 0.5)),  # type: ignore[arg-type]
        lambda: Lambert(0.5),  # type: ignore[arg-type]
        lambda: Lambert("red"),  # type: ignore[arg-type]
        lambda: Coated(GRAY, -0.1),
        lambda: Coated(GRAY, float("nan")),
        lambda: Coated(GRAY, "smooth"),  # type: ignore[arg-type]
        lambda: Coated(GRAY, 0.1, 0.9),
        lambda: Coated(GRAY, 0.1, float("inf")),
        lambda: Conductor(GRAY, 1.5),
        lambda: Ward(GRAY, GRAY, 0.1, True),
        lambda: Ward((0.6, 0.5, 0.5), GRAY, 0.1, 0.1),
    ],
)
def test_impossible_values_are_refused(make):
    with pytest.raises(EnvlightError, match="material"):
        make()


def test_equal_materials_have_equal_texts():
    # A scene's digest is made from the text.
    assert repr(Conductor([1, np.float64(0.5), 0], 1)) == repr(Conductor((1.0, 0.5, 0.0), 1.0))  # type: ignore[arg-type]
