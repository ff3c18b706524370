"""Random point sampling of the full scan: saves no sensing."""

from zlib import crc32

import numpy as np

from care_sim.base.checks import check_seed
from care_sim.base.portable_hash import portable_bytes
from care_sim.core.arrays import Floats
from care_sim.core.grid import Cells
from care_sim.core.rig import Rig
from care_sim.loops.truth import Truth
from care_sim.policies.paper.matched_fraction import MatchedFraction


class RandomPoints(MatchedFraction):
    """The first reference of the paper (Sec. 5.1): a matched fraction, drawn at random.

    `seed` and the cloud decide the draw, so that no two keyframes or episodes share one. The last
    bits of the cloud differ between processors and do not enter.
    """

    name = "random-points"
    source = "CARE paper, Sec. 5.1 (random point sampling)"

    def __init__(self, rig: Rig, truth: Truth, seed: int = 0):
        super().__init__(rig, truth)
        check_seed(seed)
        self._seed = seed

    def kept(self, cells: Cells, points: Floats, count: int) -> Cells:
        """`count` cells at random."""
        rng = np.random.default_rng((self._seed, crc32(portable_bytes(cells, points))))
        return rng.choice(cells, count, replace=False)
