"""Whether the engine `fast` answers as Bullet does: `make parity`."""
