"""What every sampler owes: the checks, their maps, their advice, and the failures that are known."""
