"""What is logged in pictures: the camera's detections, and the cells of the angular grid."""

import numpy as np
import rerun as rr

from care_sim.frames import Floats
from care_sim.moments import Moment, Stance
from care_sim.residual import wedges
from care_sim.shares import SHARES
from care_sim.types import CLASSES, ImageDetections, Rig
from care_sim.viewer import entities as looks
from care_sim.viewer.lane import Lane
from care_sim.viewer.outlines import outlines

CAMERA = "world/lidar/camera"
THIN = rr.Radius.ui_points(1)


class Pictures:
    """Logs the camera's picture and the picture of the grid."""

    def __init__(self, lane: Lane, rig: Rig):
        self._lane, self._rig = lane, rig
        camera = rig.cameras[0]
        place = rr.Transform3D(translation=camera.position, mat3x3=camera.axes.T)
        lens = rr.Pinhole(
            focal_length=camera.focal,
            width=camera.width,
            height=camera.height,
            camera_xyz=rr.ViewCoordinates.FLU,
            image_plane_distance=1.0,
        )
        lane.fix(CAMERA, place, lens)
        shares = [(n, name, colour) for n, (name, colour) in enumerate(zip(SHARES, looks.SHARE_COLOURS, strict=True))]
        lane.fix("grid", rr.AnnotationContext(shares))

    def log(self, moment: Moment, photo: bytes) -> None:
        """A keyframe and the JPEG of its camera."""
        self._lane.log(CAMERA, rr.EncodedImage(contents=photo, media_type="image/jpeg"))
        self._log_detections(moment.stance)
        self._log_grid(moment)

    def _log_detections(self, stance: Stance) -> None:
        seen = stance.belief.detections
        names = [f"false {name}" if false else name for name, false in zip(_names(seen), stance.false, strict=True)]
        for kind, chosen, colour in (
            ("explained", stance.known, looks.EXPLAINED),
            ("residual", ~stance.known, looks.RESIDUAL),
        ):
            labels = [name for name, this in zip(names, chosen, strict=True) if this]
            self._log_named(kind, seen.boxes[chosen], labels, colour)
        missed = [f"missed {name}" for name in _names(stance.missed)]
        self._log_named("missed", stance.missed.boxes, missed, looks.MISSED)

    def _log_named(self, kind: str, boxes: Floats, names: list[str], colour: tuple[int, int, int]) -> None:
        """Boxes, and their names as those of points, which the viewer does not break into lines."""
        below = np.column_stack([boxes[:, [0, 2]].mean(axis=1), boxes[:, 3]])
        points = rr.Points2D(below, labels=names, colors=colour, radii=0.0)
        self._lane.log(f"{CAMERA}/{kind}", _boxes(boxes, colour), points)

    def _log_grid(self, moment: Moment) -> None:
        belief, rig = moment.stance.belief, self._rig
        cells = np.repeat(moment.shares[:, ::-1], looks.ROW_PIXELS, axis=0)
        self._lane.log("grid/cells", rr.SegmentationImage(cells))
        hulls = outlines(rig.hulls(belief.tracks.boxes), rig.grid)
        self._lane.log("grid/hulls", _boxes(hulls, looks.EGO))
        sectors = wedges(belief.detections, rig)
        for kind, wanted, colour in (("explained", True, looks.EXPLAINED), ("residual", False, looks.RESIDUAL)):
            chosen = [cells for cells, known in zip(sectors, moment.stance.known, strict=True) if known == wanted]
            self._lane.log(f"grid/wedges/{kind}", _boxes(outlines(chosen, rig.grid), colour))


def _boxes(boxes: Floats, colour: tuple[int, int, int]) -> rr.Boxes2D:
    return rr.Boxes2D(array=boxes, array_format=rr.Box2DFormat.XYXY, colors=colour, radii=THIN)


def _names(detections: ImageDetections) -> list[str]:
    return [CLASSES[number] for number in detections.classes]
