"""How two times are compared."""

LAST_BITS_S = 1e-9
"""Times are sums of steps: they miss a round number by their last bits. Every comparison of times
allows for this much, which is far more than such an error and far less than any step.
"""
