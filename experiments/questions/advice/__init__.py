"""What to expect of a sampler on a map: a model of errors, judged on maps it has not seen."""
