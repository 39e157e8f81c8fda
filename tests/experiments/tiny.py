"""The scales of tiny experiments."""

from dataclasses import replace

from experiments.run.scale import QUICK, Scale

TINY = Scale("tiny", 24, 18, 1, 0.5, 64, 16, (4,))
TINY_QUICK = replace(TINY, name=QUICK, map_height=32, budgets=(16,))
"""What stands for scale quick where an experiment makes its maps by its scale."""
