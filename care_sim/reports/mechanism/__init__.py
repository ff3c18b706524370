"""Tables of the mechanism: the shared belief, and the account of the rays."""
