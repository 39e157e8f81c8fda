"""The scale of tiny experiments."""

from experiments.run.scale import Scale

TINY = Scale("tiny", 24, 18, 1, 0.5, 64, 16, (4,))
