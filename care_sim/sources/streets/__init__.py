"""Generated streets: seeded urban scenes for the open loop, and the films recorded in them."""
