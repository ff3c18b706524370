"""Logs of pictures: the camera's view and detections, and the cells of the grid."""

from collections.abc import Sequence
from io import BytesIO
from itertools import compress

import numpy as np
import rerun as rr
from PIL import Image

from care_sim.core.arrays import Floats, Mask
from care_sim.core.cells.stack import Grid
from care_sim.core.firing.actions import SHARES
from care_sim.core.grid import Cells
from care_sim.core.residual import wedges
from care_sim.core.types import CLASSES, ImageDetections
from care_sim.loops.one_world import OneWorld
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.watcher import TrueSituation, Watched
from care_sim.viewer import palette
from care_sim.viewer.pictures.furnished_world import backdrop, photograph
from care_sim.viewer.recording.entities import ROW_PIXELS
from care_sim.viewer.recording.lane import THIN, Lane

_CAMERA = "world/lidar/camera"
_BOX_COLOURS = {
    "explained": palette.EXPLAINED_COLOUR,
    "residual": palette.UNEXPLAINED_COLOUR,
    "missed": palette.MISSED_COLOUR,
}
_OUTLINE_COLOURS = {
    "hulls": palette.EGO_COLOUR,
    "wedges/explained": palette.EXPLAINED_COLOUR,
    "wedges/residual": palette.UNEXPLAINED_COLOUR,
}
_QUALITY = 80
"""JPEG quality out of 100, for small recordings."""


class PictureLog:
    """Logs the camera's picture, of which a film keeps none, and the picture of the grid."""

    def __init__(self, lane: Lane, loop: OneWorld | OpenLoop):
        self._lane = lane
        self._rig = loop.rig
        self._photo: Image.Image | None = None
        camera = loop.rig.cameras[0]
        place = rr.Transform3D(translation=camera.position, mat3x3=camera.axes.T)
        lens = rr.Pinhole(
            focal_length=camera.focal,
            width=camera.width,
            height=camera.height,
            camera_xyz=rr.ViewCoordinates.FLU,
            image_plane_distance=1.0,
        )
        lane.fix(_CAMERA, place, lens)
        shares = zip(range(len(SHARES)), SHARES, palette.SHARE_COLOURS.tolist(), strict=True)
        lane.fix("grid", rr.AnnotationContext([*shares]))
        for kind, colour in _BOX_COLOURS.items():
            # Explained ones stand side by side, so that their names would overlap.
            names = rr.Points2D.from_fields(
                colors=[colour], radii=[0.0], show_labels=kind != "explained"
            )
            lane.fix(
                f"{_CAMERA}/{kind}", rr.Boxes2D.from_fields(colors=[colour], radii=[THIN]), names
            )
        for entity, colour in _OUTLINE_COLOURS.items():
            lane.fix(f"grid/{entity}", rr.Boxes2D.from_fields(colors=[colour], radii=[THIN]))

        if isinstance(loop, OpenLoop):
            # Detections are drawn on it, at every keyframe.
            lane.fix(_CAMERA, _encoded(Image.fromarray(backdrop(camera))))

    def look(self, loop: OneWorld | OpenLoop) -> None:
        """Take the camera's picture of the keyframe that is about to be played."""
        if isinstance(loop, OneWorld):
            camera = loop.rig.cameras[0]
            self._photo = photograph(loop.world.bullet, camera, loop.sensor)

    def log(self, watched: Watched) -> None:
        """Log a keyframe, with the camera's picture if there is one."""
        if self._photo is not None:
            self._lane.log(_CAMERA, _encoded(self._photo))
        self._log_detections(watched.situation)
        self._log_grid(watched)

    def _log_detections(self, situation: TrueSituation) -> None:
        seen = situation.belief.detections
        kinds = ["false " if false else "" for false in situation.false]
        self._log_named("explained", seen, kinds, situation.known)
        self._log_named("residual", seen, kinds, ~situation.known)
        missed = situation.missed
        self._log_named("missed", missed, ["missed "] * len(missed), np.ones(len(missed), bool))

    def _log_named(
        self, entity: str, seen: ImageDetections, kinds: Sequence[str], chosen: Mask
    ) -> None:
        """Log boxes, and their names as those of points below them, since the viewer breaks names
        of boxes into lines.
        """
        # The picture is that of the first camera.
        rows = np.flatnonzero(chosen & (seen.cameras == 0)).tolist()
        names = [kinds[row] + CLASSES[seen.classes[row]] for row in rows]
        boxes = seen.boxes[rows]
        below = np.column_stack([boxes[:, [0, 2]].mean(axis=1), boxes[:, 3]])
        points = rr.Points2D(below, labels=names)
        self._lane.log_list(f"{_CAMERA}/{entity}", len(rows), _boxes(boxes), points)

    def _log_grid(self, watched: Watched) -> None:
        belief = watched.situation.belief
        known = watched.situation.known
        rig = self._rig
        # Left is left, as in the pictures of `care_sim.viewer.pictures.drawing.cells_picture`.
        cells = np.repeat(watched.shares[:, ::-1], ROW_PIXELS, axis=0)
        self._lane.log("grid/cells", rr.SegmentationImage(cells))
        sectors = wedges(belief.detections, rig)
        for entity, chosen in (
            ("hulls", rig.hulls(belief.tracks.boxes)),
            ("wedges/explained", list(compress(sectors, known))),
            ("wedges/residual", list(compress(sectors, ~known))),
        ):
            lines = outlines(chosen, rig.grid)
            self._lane.log_list(f"grid/{entity}", len(lines), _boxes(lines))


def _boxes(boxes: Floats) -> rr.Boxes2D:
    return rr.Boxes2D(array=boxes, array_format=rr.Box2DFormat.XYXY)


def _encoded(picture: Image.Image) -> rr.EncodedImage:
    file = BytesIO()
    picture.save(file, "JPEG", quality=_QUALITY)
    return rr.EncodedImage(contents=file.getvalue(), media_type="image/jpeg")


def outlines(sectors: Sequence[Cells], grid: Grid) -> Floats:
    """Return boxes around angular rectangles of cells, over the picture of the grid (n, 4: left,
    top, right, bottom in pixels). A rectangle across the seam of the grid has two boxes, one
    without cells none.
    """
    # Each LiDAR has its own rectangle.
    parts = [
        cells[grid.lidars_of(cells) == number]
        for cells in sectors
        for number in range(len(grid.heads))
    ]
    boxes = [box for cells in parts if len(cells) for box in _cell_boxes(cells, grid)]
    return np.array(boxes, float).reshape(-1, 4)


def _cell_boxes(cells: Cells, grid: Grid) -> list[tuple[float, ...]]:
    top = int(cells[0]) // grid.columns
    bottom = int(cells[-1]) // grid.columns + 1
    # Cells ascend row by row, and every row has the columns of the first. These have a gap where
    # the rectangle lies across the seam.
    columns = cells[: np.searchsorted(cells, (top + 1) * grid.columns)] % grid.columns
    runs = np.split(columns, np.flatnonzero(np.diff(columns) > 1) + 1)
    # The picture has the last column at its left.
    upper = top * ROW_PIXELS
    lower = bottom * ROW_PIXELS
    return [(grid.columns - 1 - run[-1], upper, grid.columns - run[0], lower) for run in runs]
