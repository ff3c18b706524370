"""A picture of the moment the brake goes on."""

import sys
from pathlib import Path

from PIL import Image

from care_sim.envs.picture import draw_keyframe
from care_sim.loop import ClosedLoop
from care_sim.types import Keyframe


class Photographer:
    """Watches an episode and writes one picture to `path`; without a path it does nothing.

    Raises OSError when the file cannot be written.
    """

    def __init__(self, path: Path | None):
        self._path = path
        self._done = path is None
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)

    def __call__(self, loop: ClosedLoop, frame: Keyframe) -> None:
        """Take the picture if this is the keyframe."""
        if self._path is not None and not self._done and frame.braking:
            Image.fromarray(draw_keyframe(loop, frame)).save(self._path, "PNG")
            self._done = True

    def report(self) -> None:
        """Say so when there was nothing to take a picture of."""
        if not self._done:
            print("the car never braked: no picture", file=sys.stderr)
