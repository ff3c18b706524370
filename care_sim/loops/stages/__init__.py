"""The stages of a keyframe of `care_sim.loops.loop`: arrays with a row for each world."""
