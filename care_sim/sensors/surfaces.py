"""How bright the surfaces are that rays met: reflectance of the material, and the angle at which it
was met.
"""

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.sensors.engines.surface_kernels import met_surfaces
from care_sim.world.bodies import ASPHALT, REFLECTANCES
from care_sim.world.body_tables import Primitives
from care_sim.world.bullet import NO_BODY


def brightness(
    parts: Primitives, origins: Floats, rays: Floats, ranges: Floats, bodies: Integers
) -> Floats:
    """(n,) reflectance times cosine of the angle of incidence (Lambert) where unit `rays` (n, 3)
    from `origins` (n, 3) or (3,) met `bodies` (n,) at `ranges` (n,), all in the world as it stands
    now; 0 where they met nothing.
    """
    # What was met and has no parts is the road: level, so that the slope of a ray is its angle.
    solid = np.isin(bodies, parts.tables[-1])
    met = np.flatnonzero(solid)
    road = np.flatnonzero(~solid & (bodies != NO_BODY))
    bright = np.zeros(len(bodies))
    bright[road] = REFLECTANCES[ASPHALT] * np.maximum(-rays[road, 2], 0.0)

    places = np.broadcast_to(origins, rays.shape)[met] + rays[met] * ranges[met, None]
    hit = bodies[met]
    found, cosines = met_surfaces(places, rays[met], hit, parts.poses[hit], parts.tables)
    reflectances = np.array([REFLECTANCES[name] for name in parts.materials])
    bright[met] = reflectances[found] * cosines
    return bright
