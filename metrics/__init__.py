"""Errors, perceptual differences and ranks: pure functions of arrays."""

from samplers import kernel_cache as kernel_cache  # before any kernel is declared
