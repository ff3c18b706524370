"""How long the car's software takes at a keyframe, stage by stage: `care-sim study vehicle`."""
