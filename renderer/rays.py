"""Counting rays."""

from dataclasses import dataclass


@dataclass(frozen=True)
class RayCount:
    """Rays of an image by kind.

    primary : one per sub-pixel, shared by all images of a view
    shadow : towards lights; brdf : in directions drawn from the BRDF
    skipped : lights or samples that were dropped before a ray existed, since they face away or
        carry nothing
    """

    primary: int = 0
    shadow: int = 0
    brdf: int = 0
    skipped: int = 0

    def __add__(self, other: "RayCount") -> "RayCount":
        return RayCount(
            max(self.primary, other.primary),
            self.shadow + other.shadow,
            self.brdf + other.brdf,
            self.skipped + other.skipped,
        )

    @property
    def traced(self) -> int:
        """Rays traced for this image alone."""
        return self.shadow + self.brdf
