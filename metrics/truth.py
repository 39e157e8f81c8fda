"""What images of a case are judged against: its reference, exposed, and what metrics make of it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Truth:
    """A reference, ready to judge images.

    image : (H, W, 3) float32, the reference times `exposure`
    exposure : the factor that every image of the case is multiplied by before it is judged
    noise_floor : RMSE of `image` by its own noise
    halves : the two independent halves whose mean the reference is, exposed; None where not kept
    """

    image: Image
    exposure: float
    noise_floor: float
    halves: tuple[Image, Image] | None = None
    _made: dict[Callable[["Truth"], Any], Any] = field(default_factory=dict, repr=False)

    def made(self, make: Callable[["Truth"], Any]) -> Any:
        """`make` of this truth: computed when it is first asked for, then kept."""
        if make not in self._made:
            self._made[make] = make(self)
        return self._made[make]

    def exposed(self, image: Image) -> Image:
        """An image of the case as metrics take it."""
        return (image * np.float64(self.exposure)).astype(np.float32)
