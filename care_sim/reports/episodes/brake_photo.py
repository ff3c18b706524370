"""A picture of the moment the brake goes on."""

import sys
from pathlib import Path

from PIL import Image

from care_sim.base.files import PNG, check_output, replacing
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.records import Keyframe
from care_sim.viewer.pictures.keyframe import draw_keyframe


class BrakePhoto:
    """Watches an episode and writes one picture to `path`; without a path it does nothing.

    Raises InvalidInput and OSError at once where no picture can be written:
    `care_sim.base.files.check_output`.
    """

    def __init__(self, path: Path | None):
        self._path = path
        self._done = path is None
        if path is not None:
            check_output(path, PNG)

    def __call__(self, loop: ClosedLoop, frame: Keyframe) -> None:
        """Take the picture if this is the keyframe."""
        if self._path is not None and not self._done and frame.braking:
            with replacing(self._path, PNG) as unfinished:
                Image.fromarray(draw_keyframe(loop, frame)).save(unfinished, "PNG")
            self._done = True

    def report(self) -> None:
        """Say so when there was nothing to take a picture of."""
        if not self._done:
            print("the car never braked: no picture", file=sys.stderr)
