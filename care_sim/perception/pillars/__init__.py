"""The learned detector: points are grouped in pillars, a network sees the pillars from above, and
peaks become boxes.

Sources: Lang et al., "PointPillars: fast encoders for object detection from point clouds", CVPR
2019 (pillars). Yin, Zhou, Kraehenbuehl, "Center-based 3D object detection and tracking", CVPR 2021
(peaks at the centres).
"""
