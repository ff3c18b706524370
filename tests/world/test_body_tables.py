import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from care_sim.world.bodies import CATALOGUE
from care_sim.world.body_tables import SHAPES, Footprints, Primitives
from care_sim.world.bullet import BulletWorld

BUS, EGO = CATALOGUE["bus"], CATALOGUE["ego"]


def footprints(*kinds_and_poses):
    made = Footprints()
    for body, (kind, pose) in enumerate(kinds_and_poses, start=1):
        made.add(body, kind.size, pose)
    return made


def test_a_box_stands_on_the_ground_and_turns_with_its_body():
    made = footprints((BUS, (1.0, 2.0, 0.0)))
    made.move_all(np.array([1]), np.array([[3.0, 4.0, 0.5]]))
    assert made.boxes[1].tolist() == [3.0, 4.0, 3.47 / 2, 11.19, 2.94, 3.47, 0.5]
    assert np.isnan(made.boxes[0]).all()


POSES = st.tuples(st.floats(-9, 9), st.floats(-6, 6), st.floats(-4, 4))


@given(
    POSES, st.lists(st.tuples(st.sampled_from(sorted(CATALOGUE)), POSES), min_size=1, max_size=6)
)
def test_whatever_touches_is_near(pose, others):
    placed = [(EGO, pose), *((CATALOGUE[name], other) for name, other in others)]
    near, world = footprints(*placed).near(1, 0.5).tolist(), BulletWorld()
    try:
        bodies = [world.add(kind, place) for kind, place in placed]
        within = [body for body in bodies[1:] if world.clearance(bodies[0], body, 0.5) < 0.4]
    finally:
        world.close()
    assert bodies == list(range(1, len(placed) + 1))
    assert set(within) <= set(near)


def test_footprints_are_near_by_their_rectangles_not_by_the_circles_around_them():
    """Two buses side by side, 3 m of room between them: the circles overlap by far."""
    beside = BUS.size[1] + 3.0
    assert not len(footprints((BUS, (0.0, 0.0, 0.0)), (BUS, (0.0, beside, 0.0))).near(1, 0.5))
    assert footprints((BUS, (0.0, 0.0, 0.0)), (BUS, (0.0, beside, 0.0))).near(1, 3.1).tolist() == [
        2
    ]


def test_tables_grow_with_the_street():
    """Earlier bodies stay, with more than there was room for, and with an id left out."""
    boxes, parts = Footprints(), Primitives()
    kinds = [CATALOGUE[name] for name in sorted(CATALOGUE)] * 5
    for body, kind in enumerate(kinds, start=1):
        boxes.add(body, kind.size, (float(body), 0.0, 0.0))
        parts.add(body, kind.parts)
        parts.poses[body, 0] = body
    ids = np.arange(1.0, len(kinds) + 1)
    assert len(kinds) > 64
    assert np.isnan(boxes.boxes[0]).all()
    assert boxes.boxes[1:, 0].tolist() == parts.poses[1:, 0].tolist() == ids.tolist()
    assert boxes.boxes[1:, 3].tolist() == [kind.size[0] for kind in kinds]
    every = [(body, part) for body, kind in enumerate(kinds, start=1) for part in kind.parts]
    shapes, halves, offsets, owners = parts.tables
    assert owners.tolist() == [body for body, _ in every]
    assert [SHAPES[shape] for shape in shapes] == [part.shape for _, part in every]
    assert (2 * halves == [part.size for _, part in every]).all()
    assert (offsets == [part.centre for _, part in every]).all()
    assert parts.materials == [part.material for _, part in every]


def test_a_body_that_comes_later_is_in_the_tables():
    parts = Primitives()
    parts.add(0, ())
    assert len(parts.tables[0]) == 0
    parts.add(1, BUS.parts)
    assert set(parts.tables[-1].tolist()) == {1}
