"""A picture of a keyframe of the open loop to be shown beside that of another policy: the scene
from above, the cells ahead, and how many first sightings were found at once.
"""

from collections.abc import Sequence

from PIL import Image, ImageDraw

from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.scene_records import SceneKeyframe
from care_sim.viewer.pictures import drawing
from care_sim.viewer.pictures.comparison import (
    CELLS_SIZE,
    COMPARISON_WIDTH,
    cells_ahead,
    write_cells_line,
)
from care_sim.viewer.pictures.drawing import BACKGROUND, FAINT_INK, INK
from care_sim.viewer.pictures.scene_from_above import (
    FOUND_COLOUR,
    MAP_SIZE,
    MISSED_COLOUR,
    PLAN_LEGEND,
    map_from_above,
    ranges_of,
)

_TOP = 36
_GRID_TOP = _TOP + MAP_SIZE[1] + 22
_HEIGHT = _GRID_TOP + CELLS_SIZE[1] + 32


def draw_scene_panel(name: str, loop: OpenLoop, frames: Sequence[SceneKeyframe]) -> Image.Image:
    """A picture of a film after the keyframes `frames`, under the heading `name`, as wide as those
    of `care_sim.viewer.pictures.comparison`. The episode is left as it was.
    """
    last = frames[-1]
    canvas = Image.new("RGB", (COMPARISON_WIDTH, _HEIGHT), BACKGROUND)
    draw = ImageDraw.Draw(canvas)
    draw.text((8, 6), name, INK, drawing.font(22))
    draw.text((250, 8), f"{last.time_s:.1f} s", FAINT_INK, drawing.font(18))
    found = f"{last.objects_found} of {last.objects} found"
    draw.text((COMPARISON_WIDTH - 8, 8), found, FAINT_INK, drawing.font(18), anchor="ra")
    # The map is wider than a panel: what is left of its middle holds all that is scored.
    left = (MAP_SIZE[0] - COMPARISON_WIDTH) // 2
    box = (left, 0, left + COMPARISON_WIDTH, MAP_SIZE[1])
    canvas.paste(map_from_above(loop, last).crop(box), (0, _TOP))
    fired = 0 if last.fired is None else len(last.fired)
    write_cells_line(canvas, _GRID_TOP - 20, fired, loop.rig)
    for row, (name_of, colour) in enumerate(reversed(PLAN_LEGEND)):
        draw.text((8, _TOP + MAP_SIZE[1] - 18 * (row + 1)), name_of, colour, drawing.font(13))
    canvas.paste(cells_ahead(loop.rig.grid, ranges_of(loop, last)), (0, _GRID_TOP))
    text, colour = _verdict(frames)
    draw.text((8, _HEIGHT - 26), text, colour, drawing.font(16))
    return canvas


def _verdict(frames: Sequence[SceneKeyframe]) -> tuple[str, drawing.Colour]:
    """How many of the first sightings so far were found at once."""
    entries = sum(frame.entries for frame in frames)
    found = sum(frame.entries_found for frame in frames)
    if not entries:
        return "no first sighting yet", FAINT_INK
    text = f"{found} of {entries} first sightings found at once"
    return text, FOUND_COLOUR if found == entries else MISSED_COLOUR
