"""Tables of the closed-loop studies."""
