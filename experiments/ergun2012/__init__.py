"""Figures of Ergun et al. on kd-tree importance sampling of environment maps, 2012."""

PAPER = "Ergun 2012"
