"""Bodies that clutter adds to a street, and space that it leaves free."""

from functools import cache

import numpy as np
import pytest

from care_sim.core.frames import turned
from care_sim.streets.clutter_bodies import (
    BED_HEIGHT_M,
    CROWN_CLUMPS,
    CROWN_FROM_M,
    LOWERED_M,
    tree,
    variants,
    verge,
)
from care_sim.streets.draft import footprints_meet
from care_sim.streets.layouts import LAYOUTS
from care_sim.streets.street import make_street
from care_sim.world.bodies import CATALOGUE, REFLECTANCES

SEEDS = (4, 5, 6, 7)
"""Every layout."""
GROUND = ("pavement", "verge")


@cache
def cluttered(seed):
    return make_street(seed, clutter=True)


@pytest.mark.parametrize("seed", SEEDS)
def test_all_else_of_a_street_stays_and_reported_bodies_follow(seed):
    clean, street = make_street(seed), cluttered(seed)
    many = len(clean.kinds)
    assert clean.clutter == ()
    assert street.kinds[:many] == clean.kinds
    assert np.array_equal(street.poses[:, :many], clean.poses)
    assert np.array_equal(street.ego, clean.ego)
    assert {*street.kinds[many:]} <= {"pedestrian", "parked bicycle"}


def test_a_seed_gives_one_clutter_and_every_kind_comes_up():
    assert make_street(5, clutter=True).digest() == cluttered(5).digest()
    assert len({cluttered(seed).digest() for seed in SEEDS}) == len(SEEDS)
    names = {kind.name for seed in SEEDS for kind, _ in cluttered(seed).clutter}
    # A column for posters comes up on one side in five.
    assert names - {"column"} == {
        *GROUND, "bush", "tree", "lamp post", "sign", "bollard", "relief", "bin", "cabinet",
        "bench", "board",
    }  # fmt: skip
    added = [cluttered(seed).kinds[len(make_street(seed).kinds) :] for seed in SEEDS]
    assert all("pedestrian" in kinds for kinds in added)
    assert any("parked bicycle" in kinds for kinds in added)


def footprints(bodies):
    return np.array([pose for _, pose in bodies]), np.array([kind.size[:2] for kind, _ in bodies])


def meeting(bodies, poses, sizes):
    """Which of the bodies meet any of the footprints."""
    own_poses, own_sizes = footprints(bodies)
    count = len(poses)
    return [
        bodies[n][0].name
        for n in range(len(bodies))
        if footprints_meet(
            np.tile(own_poses[n], (count, 1)),
            np.tile(own_sizes[n], (count, 1)),
            poses,
            sizes,
            np.zeros(count),
        ).any()
    ]


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_stands_where_anybody_drives_walks_or_stands(seed):
    street = cluttered(seed)
    standing = [one for one in street.clutter if one[0].name not in (*GROUND, "relief")]
    sizes = np.array([CATALOGUE[kind].size[:2] for kind in street.kinds])
    ego = np.array([CATALOGUE["ego"].size[:2]])
    for keyframe in range(0, len(street.ego), 6):
        poses = np.vstack([street.poses[keyframe], street.ego[keyframe]])
        assert meeting(standing, poses, np.vstack([sizes, ego])) == []
        # A relief juts out of a wall and is in it, and no wall moves.
        moved = (street.poses[keyframe] != street.poses[0]).any(axis=1)
        reliefs = [one for one in street.clutter if one[0].name == "relief"]
        moving = np.vstack([street.poses[keyframe][moved], street.ego[keyframe]])
        assert meeting(reliefs, moving, np.vstack([sizes[moved], ego])) == []


def lanes(seed):
    """(n, 2) places all over the lanes of a street, in steps of a metre and half a lane."""
    plan = LAYOUTS[list(LAYOUTS)[seed % 4]](
        np.random.default_rng(np.random.SeedSequence(seed).spawn(1)[0])
    )
    made = []
    for road, least in ((plan.main, -60.0), *((one.road, 0.0) for one in plan.joinings)):
        across = np.arange(0.2 - road.right.lane_edge_m, road.left.lane_edge_m, 1.7)
        s, d = np.meshgrid(np.arange(least, 60.0), across)
        made.append(road.curve.to_world(np.stack([s, d, 0 * s], axis=-1))[..., :2].reshape(-1, 2))
    return np.concatenate(made)


@pytest.mark.parametrize("seed", SEEDS)
def test_kerbs_and_verges_are_beside_the_lanes_of_all_roads(seed):
    places = lanes(seed)
    for kind, (x, y, heading) in cluttered(seed).clutter:
        if kind.name in GROUND:
            on = np.abs(turned(places - (x, y), -heading)) < np.array(kind.size[:2]) / 2
            assert not on.all(axis=1).any(), kind.name


def test_a_verge_rises_outwards_and_a_crown_hangs_above_heads_with_gaps():
    slope = verge(4.0, 3.0, 0.1, 0.6)
    tops = [part.centre[2] + part.size[2] / 2 for part in slope.parts]
    assert np.all(np.diff(tops) > 0)
    assert tops[0] == pytest.approx(0.14, abs=0.01)
    assert verge(4.0, 3.0, 0.05, -0.05).parts[-1].size[2] == LOWERED_M
    filled, beds = [], 0
    for one in variants(tree):
        crown, bed = one.parts[1 : CROWN_CLUMPS + 1], one.parts[CROWN_CLUMPS + 1 :]
        assert min(part.centre[2] for part in crown) > CROWN_FROM_M[0]
        assert {part.material for part in one.parts} <= {*REFLECTANCES}
        # A bed is low, and room is asked for all of it.
        beds += len(bed) > 0
        for part in bed:
            assert part.size[2] <= BED_HEIGHT_M[1]
            reach = np.abs(part.centre[:2]) + np.array(part.size[:2]) / 2
            assert (reach <= np.array(one.size[:2]) / 2 + 1e-9).all()
        low, high = (
            np.array([np.add(part.centre, way * np.array(part.size) / 2) for part in crown])
            for way in (-1, 1)
        )
        whole = np.prod(high.max(axis=0) - low.min(axis=0)) * np.pi / 6
        filled.append(sum(np.prod(part.size) for part in crown) / whole)
    assert 0.1 < np.median(filled) < 0.3
    assert 6 < beds < 18
