"""The paper: the grid, the camera model, the allocator (Algorithm 1), the residual (Algorithm 2),
forgetting (Algorithm 3).
"""
