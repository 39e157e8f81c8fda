"""What a run is: cases, measurements, budgets, the store, and who works on them."""

INTERRUPTED = 130
"""The exit status of what SIGINT ended: 128 + 2, as shells have it."""
