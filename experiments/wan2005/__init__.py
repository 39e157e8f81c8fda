"""Figures of Wan, Wong and Leung on the spherical Q²-tree, 2005."""

PAPER = "Wan 2005"
