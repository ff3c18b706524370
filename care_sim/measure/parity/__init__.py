"""Whether the engine `fast` answers as Bullet does: `care-sim parity`."""
