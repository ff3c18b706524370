"""What is logged in pictures: the camera's detections, and the cells of the angular grid."""

from itertools import compress

import numpy as np
import rerun as rr

from care_sim.core.actions import SHARES
from care_sim.core.frames import Floats
from care_sim.core.residual import wedges
from care_sim.core.rig import Rig
from care_sim.core.types import CLASSES, ImageDetections
from care_sim.loops.watcher import TrueSituation, WatchedKeyframe
from care_sim.viewer.recording import entities
from care_sim.viewer.recording.lane import THIN, Lane
from care_sim.viewer.recording.outlines import outlines

CAMERA = "world/lidar/camera"
COLOURS = {
    "explained": entities.EXPLAINED_RGB,
    "residual": entities.RESIDUAL_RGB,
    "missed": entities.MISSED_RGB,
}
OUTLINES = {
    "hulls": entities.EGO_RGB,
    "wedges/explained": entities.EXPLAINED_RGB,
    "wedges/residual": entities.RESIDUAL_RGB,
}


class PictureLog:
    """Logs the camera's picture and the picture of the grid."""

    def __init__(self, lane: Lane, rig: Rig):
        self._lane = lane
        self._rig = rig
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
        shares = [
            (n, name, colour)
            for n, (name, colour) in enumerate(zip(SHARES, entities.SHARE_COLOURS, strict=True))
        ]
        lane.fix("grid", rr.AnnotationContext(shares))
        for kind, colour in COLOURS.items():
            # explained ones stand side by side: their names would overlap
            names = rr.Points2D.from_fields(
                colors=[colour], radii=[0.0], show_labels=kind != "explained"
            )
            lane.fix(
                f"{CAMERA}/{kind}", rr.Boxes2D.from_fields(colors=[colour], radii=[THIN]), names
            )
        for entity, colour in OUTLINES.items():
            lane.fix(f"grid/{entity}", rr.Boxes2D.from_fields(colors=[colour], radii=[THIN]))

    def log(self, watched: WatchedKeyframe, photo: bytes) -> None:
        """A keyframe and the JPEG of its camera."""
        self._lane.log(CAMERA, rr.EncodedImage(contents=photo, media_type="image/jpeg"))
        self._log_detections(watched.situation)
        self._log_grid(watched)

    def _log_detections(self, situation: TrueSituation) -> None:
        seen = situation.belief.detections
        names = [
            f"false {name}" if false else name
            for name, false in zip(_names(seen), situation.false, strict=True)
        ]
        for kind, chosen in (("explained", situation.known), ("residual", ~situation.known)):
            self._log_named(kind, seen.boxes[chosen], list(compress(names, chosen)))
        self._log_named(
            "missed",
            situation.missed.boxes,
            [f"missed {name}" for name in _names(situation.missed)],
        )

    def _log_named(self, kind: str, boxes: Floats, names: list[str]) -> None:
        """Boxes, and their names as those of points, which the viewer does not break into lines."""
        below = np.column_stack([boxes[:, [0, 2]].mean(axis=1), boxes[:, 3]])
        self._lane.log_list(
            f"{CAMERA}/{kind}",
            len(boxes),
            lambda: (_boxes(boxes), rr.Points2D(below, labels=names)),
        )

    def _log_grid(self, watched: WatchedKeyframe) -> None:
        belief = watched.situation.belief
        known = watched.situation.known
        rig = self._rig
        cells = np.repeat(watched.shares[:, ::-1], entities.ROW_PIXELS, axis=0)
        self._lane.log("grid/cells", rr.SegmentationImage(cells))
        sectors = wedges(belief.detections, rig)
        for entity, chosen in (
            ("hulls", rig.hulls(belief.tracks.boxes)),
            ("wedges/explained", list(compress(sectors, known))),
            ("wedges/residual", list(compress(sectors, ~known))),
        ):
            self._log_outlines(f"grid/{entity}", outlines(chosen, rig.grid))

    def _log_outlines(self, entity: str, lines: Floats) -> None:
        self._lane.log_list(entity, len(lines), lambda: [_boxes(lines)])


def _boxes(boxes: Floats) -> rr.Boxes2D:
    return rr.Boxes2D(array=boxes, array_format=rr.Box2DFormat.XYXY)


def _names(detections: ImageDetections) -> list[str]:
    return [CLASSES[number] for number in detections.classes]
