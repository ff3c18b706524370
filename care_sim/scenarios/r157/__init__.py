"""Cut-ins of UN Regulation 157: the grid, which of them a careful driver prevents, the world."""
