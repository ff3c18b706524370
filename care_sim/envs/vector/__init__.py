"""Many worlds of the closed loop at once, as Gymnasium's vector environments."""
