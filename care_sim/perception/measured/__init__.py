"""Detectors as they were measured on real data, from counts of returns: recall, persistence of
misses, scores, errors and false boxes of CenterPoint, Megvii and PointRCNN.

`shipped/README.md` is their card: the data, the formula, the numbers and what they cannot tell.
"""
