"""Algorithm 2 of the paper: camera detections that no forecast explains, as wedges of cells."""

import math

import numpy as np

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.belief import Belief
from care_sim.core.beliefs import Beliefs
from care_sim.core.cells.sets import CellSets, WorldSets, kept_of_each
from care_sim.core.frames import turned
from care_sim.core.pinhole import MountedCameras, box_rays, mounted_model, pixel
from care_sim.core.rig import Rig
from care_sim.core.types import ImageDetections, Tracks

# Numbers of a module are what compiled code can hold.
_CLASS, _CAMERA = ImageDetections.CLASS, ImageDetections.CAMERA
_YAW_CHANGE, _LABEL = ImageDetections.YAW_CHANGE, Tracks.CLASS
_LEFT, _TOP, _RIGHT, _BOTTOM = range(ImageDetections.BOX.start, ImageDetections.BOX.stop)
_X, _Y, _Z = range(Tracks.CENTRE.start, Tracks.CENTRE.stop)


def camera_layers(belief: Belief, rig: Rig) -> tuple[CellSets, CellSets]:
    """(U, M) of Algorithm 2: the wedges of unexplained and of explained detections.

    Both are in the order of the detections.
    """
    unexplained, known = camera_layers_of(Beliefs.of(belief, rig))
    return unexplained.sets, known.sets


def camera_layers_of(beliefs: Beliefs) -> tuple[WorldSets, WorldSets]:
    """`camera_layers` of several worlds."""
    every, known = wedges_of(beliefs), explained_of(beliefs)
    return every.take(~known), every.take(known)


def unexplained_layer_of(beliefs: Beliefs) -> WorldSets:
    """U of Algorithm 2 alone, the reserve layer of CARE: nothing is laid for what is explained."""
    new = ~explained_of(beliefs)
    counts = kept_of_each(new, beliefs.detected)
    return WorldSets(wedges(beliefs.detections.take(new), beliefs.rig), counts)


def wedges_of(beliefs: Beliefs) -> WorldSets:
    """`wedges` of several worlds."""
    return WorldSets(wedges(beliefs.detections, beliefs.rig), beliefs.detected)


def explained_of(beliefs: Beliefs) -> Mask:
    """`explained` of several worlds, by the forecasts of the own world."""
    seen, known = (beliefs.detections, beliefs.detected), (beliefs.tracks, beliefs.tracked)
    rows: Mask = _explaining(seen, known, beliefs.rig) >= 0
    return rows


def explained(detections: ImageDetections, tracks: Tracks, rig: Rig) -> Mask:
    """(n,) whether a forecast explains each image box; see `explaining_tracks`."""
    return explaining_tracks(detections, tracks, rig) >= 0


def explaining_tracks(detections: ImageDetections, tracks: Tracks, rig: Rig) -> Integers:
    """(n,) the row of the first forecast that explains each image box, -1 without one.

    A forecast explains a box of its class in which its centre appears (Eq. 2, `_first_explaining`).
    Matching uses the full forecasts, never hulls that forgetting has shrunk. Raises IndexError for
    a detection of a camera that the rig does not have.
    """
    counts = np.array([len(detections), len(tracks)])
    return _explaining((detections, counts[:1]), (tracks, counts[1:]), rig)


def _explaining(
    seen: tuple[ImageDetections, Integers], known: tuple[Tracks, Integers], rig: Rig
) -> Integers:
    """`explaining_tracks` of several worlds: a row is that among the forecasts of all. Detections
    and tracks come world after world, with how many (W,) are of each.
    """
    (detections, detected), (tracks, tracked) = seen, known
    if not len(detections):
        return np.zeros(0, np.int64)
    tables = detections.rows(), tracks.rows()
    return _first_explaining(*tables, detected, tracked, rig.camera_models)


def wedges(detections: ImageDetections, rig: Rig) -> CellSets:
    """The depth-free wedge W(d) of every detection: the cells behind its image box, dilated by the
    margins of the rig.
    """
    if not len(detections):
        return CellSets.of([])
    rays = wedge_rays(detections, rig)
    starts = ray_starts(detections, rig)
    return rig.grid.wedges(rays, rig.azimuth_margin, rig.elevation_margin, starts)


def wedge_rays(detections: ImageDetections, rig: Rig) -> Floats:
    """(n, 9, 3) the rays through the image box of every detection, in the sensor frame of now;
    their order is that of `care_sim.core.pinhole.PinholeCamera.box_rays`.
    """
    rows = detections.rows()
    # The sines and cosines are NumPy's, as in `turned`.
    back = -rows[:, _YAW_CHANGE]
    rays: Floats = _turned_box_rays(rows, np.cos(back), np.sin(back), rig.camera_models)
    return rays


def ray_starts(detections: ImageDetections, rig: Rig) -> Floats | None:
    """(n, 3) where the rays of every detection begin, in the sensor frame of now; None where all
    count as beginning at the one LiDAR.
    """
    places = rig.wedge_starts
    if places is None:
        return None
    # The camera has gone round with the car since its picture.
    starts: Floats = _turned_since(places[detections.cameras, None], detections)[:, 0]
    return starts


def _turned_since(vectors: Floats, detections: ImageDetections) -> Floats:
    """Return vectors (n, k, 3) along the axes of the present sensor frame. `vectors` are in the
    sensor frames at which the pictures were taken. The car has turned since, so the vectors turn
    the other way.
    """
    return turned(vectors, -detections.yaw_changes[:, None])


@compiled()
def _turned_box_rays(
    detections: Floats, cosines: Floats, sines: Floats, cameras: MountedCameras
) -> Floats:
    """`wedge_rays` of `detections` (n, 9), all of whose rays turn by the angle with this cosine and
    sine (n,).
    """
    numbers = detections[:, _CAMERA].astype(np.int64)
    rays = box_rays(detections[:, _LEFT : _BOTTOM + 1], numbers, cameras)
    for n in range(len(rays)):
        cos, sin = cosines[n], sines[n]
        for ray in rays[n]:
            x, y = ray[0], ray[1]
            ray[0], ray[1] = cos * x - sin * y, sin * x + cos * y
    return rays


@compiled()
def _first_explaining(
    detections: Floats,
    tracks: Floats,
    detected: Integers,
    tracked: Integers,
    cameras: MountedCameras,
) -> Integers:
    """Eq. 2: (n,) the row of the first forecast of the class of each detection whose centre lies in
    its image box, -1 without one.

    `detections` (n, 9) and forecasts `tracks` (m, 13) are those of all worlds, `detected` (W,) and
    `tracked` (W,) of each. Each world is matched by itself.
    """
    # Forecasts come nearest first, so the first match is the nearest one.
    found = np.full(len(detections), -1)
    n = first = 0
    for world in range(len(detected)):
        last = n + detected[world]
        end = first + tracked[world]
        while n < last:
            one = detections[n]
            camera = mounted_model(cameras, 0, int(one[_CAMERA]))
            cos, sin = math.cos(one[_YAW_CHANGE]), math.sin(one[_YAW_CHANGE])
            for m in range(first, end):
                if tracks[m, _LABEL] == one[_CLASS]:
                    # The forecast is of now and the picture older: the centre is turned back to
                    # where the car's axes were then.
                    x, y, z = tracks[m, _X], tracks[m, _Y], tracks[m, _Z]
                    u, v, _ = pixel(cos * x - sin * y, sin * x + cos * y, z, camera)
                    # Behind the camera a pixel is NaN, which lies in no box.
                    if one[_LEFT] <= u <= one[_RIGHT] and one[_TOP] <= v <= one[_BOTTOM]:
                        found[n] = m
                        break
            n += 1
        first = end
    return found
