"""Exit statuses that mean something."""

INTERRUPTED = 130
"""Ended by SIGINT: 128 + 2, as shells have it."""
