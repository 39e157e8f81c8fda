"""Tables and figures of Arbree et al. on center-surround area lights, 2005."""

PAPER = "Arbree 2005"
