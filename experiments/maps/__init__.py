"""Environment maps: suites, their kinds and what can be measured on them."""
