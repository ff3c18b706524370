"""The camera's picture in colour, small enough to keep."""

from io import BytesIO

import numpy as np
from PIL import Image

from care_sim.loops.closed_loop import ClosedLoop

SKY, ROAD = (186, 203, 218), (58, 60, 65)
NOTHING = 255
"""What the renderer paints where no body is."""
QUALITY = 80


def photograph(loop: ClosedLoop) -> bytes:
    """A JPEG of what the camera shows now, houses left out, which it need not render; sky and road
    behind it.
    """
    camera = loop.rig.cameras[0]
    picture = loop.world.bullet.colours(camera, loop.sensor)
    red, green, blue = picture[..., 0], picture[..., 1], picture[..., 2]
    backdrop = np.full_like(picture, ROAD)
    backdrop[: camera.height // 2] = SKY
    np.copyto(backdrop, picture, where=((red & green & blue) != NOTHING)[..., None])
    file = BytesIO()
    Image.fromarray(backdrop).save(file, "JPEG", quality=QUALITY)
    return file.getvalue()
