"""What every sampler owes: the checks, their maps, their advice, and known failures."""
