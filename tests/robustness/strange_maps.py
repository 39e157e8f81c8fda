"""Environment maps that no camera gives, by thousands: every sampler must make something of them.

A recipe describes a map by a few numbers, so that a property-based test can shrink what fails and a
long campaign can draw from the same space.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.robustness.guarded import Guard
from tests.robustness.tally import NotFinite, Tally

PATTERNS = ("noise", "constant", "ramp", "checkers", "rows", "columns")
HOLES = ("none", "some", "most", "all but one", "half", "poles", "all")
SPIKES = ("none", "one", "seam", "pole", "five")
CHANNELS = ("grey", "coloured", "red", "blue")
MOST_ROWS = 24
SEED = 0
SECONDS, PATIENCE = 120.0, 3600.0
"""Time limits of a map, and of one for which kernels are compiled."""
MOST_DOUBLINGS = 8.0
LEVELS = (-30.0, 30.0)
"""Decimal logarithm of the mean level: whatever unit somebody may have used."""
DECADES = (0.0, 12.0)
SPIKE_DECADES = (0.0, 9.0)
TOP = 1e36
"""No value is above it, so that sums over a map and shading stay within float32."""


@dataclass(frozen=True)
class MapRecipe:
    """A map in a few numbers.

    rows : its height
    level : decimal logarithm of its typical radiance
    decades : range of the pattern, in powers of ten
    spike_decades : by how much spikes outshine it"""

    pattern: str
    holes: str
    spikes: str
    channels: str
    rows: int
    level: float
    decades: float
    spike_decades: float
    seed: int

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "MapRecipe":
        """Any of them."""
        return cls(
            str(rng.choice(PATTERNS)), str(rng.choice(HOLES)), str(rng.choice(SPIKES)),
            str(rng.choice(CHANNELS)), int(rng.integers(1, MOST_ROWS + 1)),
            float(rng.choice([0.0, rng.uniform(*LEVELS)])), float(rng.uniform(*DECADES)),
            float(rng.uniform(*SPIKE_DECADES)), int(rng.integers(1 << 31)),
        )  # fmt: skip

    def radiance(self) -> NDArray[np.float32]:
        """The map (H, 2H, 3)."""
        rng = np.random.default_rng(self.seed)
        rows, columns = np.indices((self.rows, 2 * self.rows))
        across = {
            "noise": rng.uniform(-0.5, 0.5, rows.shape),
            "constant": np.zeros(rows.shape),
            "ramp": columns / columns.max() - 0.5,
            "checkers": (rows + columns) % 2 - 0.5,
            "rows": rows % 2 - 0.5,
            "columns": columns % 2 - 0.5,
        }[self.pattern]
        value = 10.0 ** (self.level + self.decades * across)
        value[self._holes(rng)] = 0.0
        for row, column in self._spikes(rng):
            value[row, column] = 10.0 ** (self.level + self.spike_decades)
        colour = {
            "grey": np.ones(3),
            "coloured": rng.uniform(0.0, 1.0, (*rows.shape, 3)),
            "red": np.array([1.0, 0.0, 0.0]),
            "blue": np.array([0.0, 0.0, 1.0]),
        }[self.channels]
        return np.minimum(value[..., None] * colour, TOP).astype(np.float32)

    def _holes(self, rng: np.random.Generator) -> NDArray[np.bool_]:
        shape = (self.rows, 2 * self.rows)
        row = np.arange(self.rows)[:, None] + np.zeros(shape)
        chance = rng.random(shape)
        return {
            "none": np.zeros(shape, bool),
            "some": chance < 0.3,
            "most": chance < 0.95,
            "all but one": chance > chance.min(),
            "half": row >= self.rows / 2,
            "poles": (row == 0) | (row == self.rows - 1),
            "all": np.ones(shape, bool),
        }[self.holes]

    def _spikes(self, rng: np.random.Generator) -> list[tuple[int, int]]:
        anywhere = [
            (int(rng.integers(self.rows)), int(rng.integers(2 * self.rows))) for _ in range(5)
        ]
        middle = self.rows // 2
        return {
            "none": [],
            "one": anywhere[:1],
            "seam": [(middle, 0), (middle, 2 * self.rows - 1)],
            "pole": [(0, anywhere[0][1])],
            "five": anywhere,
        }[self.spikes]


def check(task: tuple[MapRecipe, str, int]) -> str:
    """Measure a map, prepare and render it by the sampler of this name; says how many lights.

    Raises NotFinite for a result with NaN or infinity, ValueError for negative values and for more
    lights than the budget."""
    from experiments.maps.features import map_features
    from experiments.run.rendering import light_count
    from renderer.render import render
    from samplers import EnvironmentMap, make_sampler

    recipe, name, count = task
    environment = EnvironmentMap.from_array(recipe.radiance(), "strange")
    if not np.isfinite(list(map_features(environment).values())).all():
        raise NotFinite("a feature of the map")
    sampler = make_sampler(name)
    count = max(count, sampler.minimum_count)
    lighting = sampler.prepare(environment, count, np.random.default_rng(recipe.seed))
    lights = light_count(lighting)
    if lights > count:
        raise ValueError(f"{lights} lights for a budget of {count}")
    image = render(_view(), lighting, environment, seed=0).image
    if not np.isfinite(image).all():
        raise NotFinite(f"{int((~np.isfinite(image)).sum())} values are NaN or infinite")
    if image.min() < 0.0:
        raise ValueError(f"a value of {image.min()}")
    return f"{lights} lights"


@cache
def _view() -> Any:
    """Boxes on the ground, small: shadows, a sky, and a coverage that is not all."""
    from renderer import scenes
    from renderer.view import make_view

    return make_view(scenes.make("three-boxes"), 16, 12, 1)


def _compile_kernels(names: list[str]) -> None:
    """Let each sampler work once without haste: compiling is not what the time limit is for."""
    recipe = MapRecipe("noise", "some", "one", "coloured", 16, 0.0, 3.0, 4.0, 0)
    with Guard(check, PATIENCE) as guard:
        for name in names:
            for count in (1, 64):
                guard.call((recipe, name, count))


def run_campaign(
    count: int, seed: int = SEED, told: Callable[[int], None] = lambda number: None
) -> Tally:
    """Draw `count` maps; samplers take turns, budgets are drawn.

    told : called with the number of each map that is done"""
    from samplers import sampler_names

    names, tally = sampler_names(), Tally()
    _compile_kernels(names)
    with Guard(check, SECONDS) as guard:
        for number in range(count):
            rng = np.random.default_rng([seed, number])
            recipe, name = MapRecipe.draw(rng), names[number % len(names)]
            budget = int(2.0 ** rng.uniform(0.0, MOST_DOUBLINGS))
            verdict = guard.call((recipe, name, budget))
            tally.add(number, name, f"{recipe}, {budget} lights", verdict)
            told(number)
        tally.slowest, tally.peak_bytes = guard.slowest, guard.peak_bytes
    return tally
