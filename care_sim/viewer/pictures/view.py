"""What a picture shows of a keyframe. Each loop fills it in, and one code draws it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.viewer.palette import State

PICTURE_WIDTH = 960
PANEL_WIDTH = 512
"""Of a picture that is shown beside others."""
BELOW_SIZE = (392, 220)
"""Of what is below the street, to the left of the grid."""


class Scenery(NamedTuple):
    """The street, as wide as the picture, and what is below it: a picture of `BELOW_SIZE`, or one
    as wide as the street; None in a panel.
    """

    street: Image.Image
    below: Image.Image | None


@dataclass(frozen=True)
class View:
    """A keyframe of either loop, before the first scan with nothing fired."""

    rig: Rig
    time_s: float
    """Seconds from the start."""
    progress: str
    """How far the episode is: the speed of the car, or how many objects are found."""
    braking: bool
    contact: str | None
    """Whom the car has hit."""
    aside: str
    """What a picture tells besides, where nobody is hit."""
    verdict: State
    """What a panel tells, where nobody is hit."""
    fired: Cells | None
    """(n,) the cells that fired, each as often as it was fired."""
    ranges: NDArray[np.floating]
    """(E, A) the scan in metres: 0 not fired, maximum range without a return."""
    shares: NDArray[np.uint8] | None
    """(E, A) the shares of the budget, a place in `care_sim.core.actions.SHARES` for each cell.
    They colour the cells; without them the ranges do.
    """
    is_moment: bool
    """Whether a picture of the episode is of this keyframe: the car brakes, or somebody appears."""
    scenery: Callable[[bool], Scenery]
    """Draws the scenery of a whole picture, or of a panel."""
