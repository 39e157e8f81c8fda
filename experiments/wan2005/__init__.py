"""Figures of Wan, Wong and Leung, "Spherical Q²-tree for sampling dynamic environment sequences",
EGSR 2005.
"""

PAPER = "Wan 2005"
