"""Colours of pictures and recordings, the same in both: red, green, blue."""

from typing import NamedTuple

import numpy as np

from care_sim.loops.open_loop import SceneKeyframe

Colour = tuple[int, int, int]

INK = (235, 237, 240)
FAINT_INK = (150, 155, 162)
BACKGROUND = (24, 26, 30)
NOT_FIRED_COLOUR = (44, 47, 53)
NO_RETURN_COLOUR = (112, 116, 124)

EXPLAINED_COLOUR = (90, 220, 255)
UNEXPLAINED_COLOUR = (255, 170, 40)
FALSE_COLOUR = (255, 105, 180)
"""Colours of camera boxes: explained by a forecast, unexplained, false."""
MISSED_COLOUR = (255, 80, 120)
"""Colour of boxes that only a faultless camera would have reported."""
COASTING_COLOUR = (120, 140, 190)
"""Colour of a track that the last scan missed; its box is a forecast."""
BRAKING_COLOUR = (255, 80, 70)
EGO_COLOUR = (200, 204, 212)

FOUND_COLOUR = (80, 230, 110)
NOT_FOUND_COLOUR = (255, 120, 60)
UNSCORED_COLOUR = (95, 100, 108)
"""Colours of annotated objects, the last for those beyond the scored range."""

SHARE_COLOURS = np.array(
    [
        NOT_FIRED_COLOUR,
        (80, 200, 255),
        (255, 150, 30),
        (112, 116, 132),
        (170, 225, 110),
        (150, 120, 170),
    ],
    np.uint8,
)
"""Colours of cells and their returns, by place in `care_sim.core.firing.actions.SHARES`."""


def found_colour(keyframe: SceneKeyframe, row: int) -> Colour:
    """Return the colour of an annotated object, by its state."""
    if keyframe.found[row]:
        return FOUND_COLOUR
    return NOT_FOUND_COLOUR if keyframe.scored[row] else UNSCORED_COLOUR


def box_colour(known: bool, false: bool) -> Colour:
    """Return the colour of a camera box. False boxes have one colour, explained or not."""
    if false:
        return FALSE_COLOUR
    return EXPLAINED_COLOUR if known else UNEXPLAINED_COLOUR


class State(NamedTuple):
    """The state of an actor: words and their colour."""

    words: str
    colour: Colour


OUT_OF_VIEW = State("out of view", (225, 225, 225))
IN_VIEW = State("in view", (255, 170, 40))
DETECTED = State("detected", FOUND_COLOUR)
HIT = State("hit", BRAKING_COLOUR)
