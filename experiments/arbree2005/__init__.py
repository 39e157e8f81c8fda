"""Table and figures of Arbree, Walter and Bala, "Pre-processing environment maps for dynamic
hardware shadows", 2005.
"""

PAPER = "Arbree 2005"
