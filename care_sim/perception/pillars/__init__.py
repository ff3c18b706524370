"""The learned detector: points gather in pillars, a network looks at them from above, peaks become
boxes.

After Lang et al., "PointPillars: fast encoders for object detection from point clouds", CVPR 2019
(pillars), and Yin, Zhou, Kraehenbuehl, "Center-based 3D object detection and tracking", CVPR 2021
(peaks at the centres).
"""
