"""Closed-loop worlds in batches: the keyframe of `care_sim.loops.closed_loop` over arrays."""
