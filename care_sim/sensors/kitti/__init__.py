"""The camera profile `kitti`: a 2D detector as it was measured on KITTI's object benchmark.

The detector's boxes with scores on 1,895 pictures of the benchmark's validation half were compared
with KITTI's labels (Geiger et al. 2012). `measured.json` holds the fitted numbers, and
`results/degraded-sensing.md` the comparison. Lengths are in pixels of a picture of
KITTI's focal length, 721.5 pixels.
"""

from care_sim.sensors.kitti.recall import recall

__all__ = ["recall"]
