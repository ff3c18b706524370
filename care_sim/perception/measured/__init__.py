"""Detectors as measured on real data, by number of returns: recall, persistence of misses, scores,
errors and false boxes of CenterPoint, Megvii and PointRCNN.

`shipped/README.md` is their card: data, formula, numbers and limitations.
"""
