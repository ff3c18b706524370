"""Words in pictures: none lies over another, and what comes first keeps its place."""

from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, ImageDraw

from care_sim.viewer.pictures.labels import Labels

SIZE = (300, 200)
INK = (255, 0, 0)
LONG = "a text that is far too long for a picture as small as this one is"
places = st.tuples(st.floats(-20, SIZE[0] + 20), st.floats(-20, SIZE[1] + 20))


class Pen:
    """A drawing pen that remembers the plates."""

    def __init__(self):
        self.plates = []
        self.canvas = Image.new("RGB", SIZE, (9, 9, 9))
        self._draw = ImageDraw.Draw(self.canvas)

    def __getattr__(self, name):
        return getattr(self._draw, name)

    def rectangle(self, area, colour):
        self.plates.append(area)
        self._draw.rectangle(area, colour)


def apart(one, other):
    return one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]


@given(st.lists(st.tuples(places, st.sampled_from(("truck", "20 m", LONG)))))
def test_no_plate_lies_over_another_or_over_the_edge(wanted):
    pen = Pen()
    labels = Labels(pen)
    for at, text in wanted:
        labels.over(at, text, INK)
    for number, one in enumerate(pen.plates):
        assert all(apart(one, other) for other in pen.plates[:number])
    for left, top, right, bottom in pen.plates:
        assert min(left, top) >= 0
        assert right <= SIZE[0]
        assert bottom <= SIZE[1]


def test_the_second_of_two_moves_up_and_a_third_without_room_is_left_out():
    pen = Pen()
    labels = Labels(pen)
    for _ in range(6):
        labels.over((150, 190), "truck", INK)
    first, second, *others = pen.plates
    assert second[3] < first[1]
    assert (first[0], first[2]) == (second[0], second[2])
    assert len(others) == 1


def test_a_label_leaves_the_arrow_in_sight():
    pen = Pen()
    labels = Labels(pen)
    labels.arrow((150, 150), "person", INK)
    labels.over((150, 120), "truck", INK)
    assert all(pen.canvas.getpixel((150, y)) == INK for y in range(100, 128))


def test_text_beside_a_point_ends_there_and_without_room_it_is_left_out():
    pen = Pen()
    labels = Labels(pen)
    labels.beside((60, 90), "20 m", INK, 12)
    ((_, top, right, bottom),) = pen.plates
    assert (right, (top + bottom) / 2) == (60, 90)
    for at in ((60, 92), (5, 30), (60, 1), (60, SIZE[1] - 1), (SIZE[0] + 5, 90)):
        labels.beside(at, "20 m", INK, 12)
    assert len(pen.plates) == 1
