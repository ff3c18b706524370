"""A street: everything that stands and moves in a scene over its keyframes. Pure data, drawn from a
seed.

Every number has its reason where it is used, and all were fixed before any policy ran. Counts of
nuScenes are those of its annotations in trainval (34,149 keyframes), by class and attribute.

Seeds 2000 to 2023 belong to neither list below. A scene of them has 26 first sightings within 50 m,
where nuScenes has 28 (31 with `presence="visible"` of `care_sim.evaluation.sightings`). It has 22
annotated objects per keyframe within 50 m, where nuScenes has 24 of the five classes at all ranges.
"""

import hashlib
from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.core.types import Ego
from care_sim.streets.clutter import Placed, place_clutter
from care_sim.streets.draft import STEP_S, STREET_KEYFRAME_S, Draft
from care_sim.streets.drivers import BEYOND_M, drive_joining, drive_main
from care_sim.streets.furniture import JOINING_M, furnish
from care_sim.streets.kerbs import kerb_lines
from care_sim.streets.layouts import LAYOUTS
from care_sim.streets.people import cross_and_emerge, populate

EVALUATION_SEEDS = tuple(range(150))
"""150 scenes, as many as the validation split of nuScenes has. They are the first: nobody chose
among them.
"""
CALIBRATION_SEEDS = tuple(range(1000, 1020))
"""20 other scenes, for choices before the evaluation. They are far away, so that neither list grows
into the other.
"""


@dataclass(frozen=True)
class Street:
    """Bodies by `kinds` (n,) of the catalogue, with world `poses` (k, n, 3) at every keyframe; the
    ego's `ego` poses (k, 3) and `motion` (k,). `clutter` holds bodies without a class, with their
    poses. `kerbs` are lines (n, 2) in the world, for pictures.
    """

    name: str
    kinds: tuple[str, ...]
    poses: Floats
    ego: Floats
    motion: tuple[Ego, ...]
    clutter: tuple[Placed, ...] = ()
    kerbs: tuple[Floats, ...] = ()

    def digest(self) -> str:
        """Return SHA-256 over the kinds and over all poses in whole millimetres and milliradians,
        ego first, then the clutter. It is equal on every machine whose arithmetic agrees that far.
        """
        content = hashlib.sha256(",".join(self.kinds).encode())
        for poses in (self.ego, self.poses):
            whole = np.round(np.ascontiguousarray(poses) * 1000).astype("<i8")
            content.update(whole.tobytes())
        for kind, pose in self.clutter:
            sizes = [
                kind.size,
                pose,
                *(number for part in kind.parts for number in (part.size, part.centre)),
            ]
            content.update(np.round(1000 * np.array(sizes)).astype("<i8").tobytes())
        return content.hexdigest()


def street_name(seed: int) -> str:
    """Return the name of the street of a seed."""
    return f"street-{seed:04d}-{_layout(seed)}"


def make_street(seed: int, clutter: bool = False) -> Street:
    """Make the street of a seed. Layouts come in turn, everything else is drawn, only from the
    seed. With `clutter` (`care_sim.streets.clutter`) the same street has more in it.
    """
    layout = _layout(seed)
    # Each part has its own stream, so that a change of one leaves the others' draws. Traffic comes
    # first: standing bodies and walkers find room around it.
    plans, traffic, furniture, people, strewing = (
        np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(5)
    )
    plan = LAYOUTS[layout](plans)
    draft = Draft(traffic)
    drive = drive_main(draft, plan)
    for joining in plan.joinings:
        drive_joining(draft, joining, plan.main)
    span = (-BEYOND_M, float(drive.along[-1]) + BEYOND_M)
    draft.rng = furniture
    furnish(draft, plan, span)
    draft.rng = people
    cross_and_emerge(draft, plan.main, (5.0, float(drive.along[-1]) + BEYOND_M / 2))
    roads = [
        (plan.main, span),
        *(
            (joining.road, (plan.main.side(joining.sign).front_m, JOINING_M))
            for joining in plan.joinings
        ),
    ]
    for road, reach in roads:
        populate(draft, road, reach)
    draft.rng = strewing
    strewn = place_clutter(draft, roads) if clutter else ()
    # Ways are sampled more often than keyframes, for the tests of room.
    every = round(STREET_KEYFRAME_S / STEP_S)
    poses = np.stack(draft.ways, axis=1)[::every]
    return Street(
        street_name(seed),
        tuple(draft.kinds),
        poses,
        drive.poses[::every],
        drive.motion[::every],
        strewn,
        kerb_lines(plan, span, JOINING_M),
    )


def _layout(seed: int) -> str:
    return list(LAYOUTS)[seed % len(LAYOUTS)]
