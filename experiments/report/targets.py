"""Whether what was wanted is reached, in words."""

MET = "met"


def target_verdict(excess: float) -> str:
    """`MET`, or by how much a target is missed.

    Parameters
    ----------
    excess : what is reached over what is wanted, where less is better; else the other way round
    """
    if excess <= 1:
        return MET
    factor = f"{excess:.2f}"
    return "missed by less than 0.5 %" if factor == "1.00" else f"missed by a factor of {factor}"
