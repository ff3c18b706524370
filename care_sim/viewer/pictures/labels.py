"""Labels in pictures, without overlap."""

from PIL import ImageDraw

from care_sim.viewer.palette import BACKGROUND, Colour
from care_sim.viewer.pictures.drawing import font

_Area = tuple[float, float, float, float]
"""Left, top, right, bottom, pixels."""
_MARGIN = 3
_FURTHEST = 2.5
"""Heights that a label may move up: farther away its object is unclear."""
_SHAFT = 34
"""Length of an arrow over its head, pixels."""


class Labels:
    """The labels of one picture, drawn after its boxes, so that no box covers them.

    Earlier labels keep their place. A later label moves up past them, and is left out if there is
    no room close above.
    """

    def __init__(self, draw: ImageDraw.ImageDraw):
        self._draw = draw
        self._taken: list[_Area] = []

    def over(self, at: tuple[float, float], text: str, colour: Colour, size: int = 13) -> None:
        """Write text centred over a point, on a dark plate, kept inside the picture. A text that
        does not fit is left out.
        """
        width, height = self._plate(text, size)
        canvas = self._draw.im.size
        x = min(max(at[0] - width / 2, 0), canvas[0] - width)
        y = min(max(at[1] - height - 2, 0), canvas[1] - height)
        if area := self._moved_up((x, y, x + width, y + height)):
            self._write(area, text, colour, size)

    def beside(self, at: tuple[float, float], text: str, colour: Colour, size: int) -> None:
        """Write text that ends at a point, if there is room. It does not move: a number stays at
        its value.
        """
        width, height = self._plate(text, size)
        area = at[0] - width, at[1] - height / 2, at[0], at[1] + height / 2
        if not any(_overlap(area, other) for other in self._taken):
            self._write(area, text, colour, size)

    def arrow(self, tip: tuple[float, float], text: str, colour: Colour) -> None:
        """Draw an arrow that points down at the label of `tip`, with its own text above."""
        x, y = tip[0], tip[1] - 20
        self.over((x, y - _SHAFT - 2), text, colour, 15)
        self._draw.line((x, y - _SHAFT, x, y - 8), colour, 4)
        self._draw.polygon([(x - 9, y - 14), (x + 9, y - 14), (x, y)], colour)
        self._taken.append((x - 9, y - _SHAFT, x + 9, y))

    def _moved_up(self, area: _Area) -> _Area | None:
        left, top, right, bottom = area
        height = bottom - top
        least = max(0, top - _FURTHEST * height)
        while obstacles := [one for one in self._taken if _overlap(area, one)]:
            bottom = min(one[1] for one in obstacles) - 1
            if bottom - height < least:
                return None
            area = left, bottom - height, right, bottom
        return area

    def _plate(self, text: str, size: int) -> tuple[float, float]:
        left, top, right, bottom = self._draw.textbbox((0, 0), text, font(size))
        return right - left + 2 * _MARGIN, bottom - top + 2 * _MARGIN

    def _write(self, area: _Area, text: str, colour: Colour, size: int) -> None:
        canvas = self._draw.im.size
        if min(area) < 0 or area[2] > canvas[0] or area[3] > canvas[1]:
            return
        self._draw.rectangle(area, BACKGROUND)
        # A text does not begin at its own origin: its box tells where the ink lies.
        left, top, _, _ = self._draw.textbbox((0, 0), text, font(size))
        at = area[0] + _MARGIN - left, area[1] + _MARGIN - top
        self._draw.text(at, text, colour, font(size))
        self._taken.append(area)


def _overlap(one: _Area, other: _Area) -> bool:
    return one[0] < other[2] and other[0] < one[2] and one[1] < other[3] and other[1] < one[3]
