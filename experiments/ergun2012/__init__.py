"""Figures of Ergun et al. on kd-tree importance sampling of environment maps, 2012."""

PAPER = "Ergun 2012"
NOT_MADE = {
    "Fig. 5": (
        "frames a second by number of samples",
        "there is no graphics card; `kd-tree-throughput` counts samples, whatever their number",
    ),
}
"""What nothing here makes: what it shows, and why."""
