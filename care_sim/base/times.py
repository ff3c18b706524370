"""How two times are compared."""

LAST_BITS_S = 1e-9
"""Times are sums or multiples of steps, and miss a round number by their last bits. A comparison of
times allows for this much: far more than such an error, and far less than any step.
"""
