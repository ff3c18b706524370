"""The detector `cluster`, which reads only points: remove the road, group points, fit boxes,
classify.
"""
