"""What the papers leave open: each choice of each sampler, measured."""
