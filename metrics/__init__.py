"""Errors, perceptual differences and ranks: pure functions of arrays."""
