"""How to read the tables of the first-sighting protocol."""

from care_sim.reports.protocol.differences import OVER_EVENTS

READING = (
    "Differences are points of recall (TTFD: keyframes), positive where the first named has more, "
    "with 95% intervals of 10,000 paired resamples of scenes, or of events where marked "
    f"{OVER_EVENTS}; bold: the interval excludes zero. (paper): what the paper reports, measured "
    "on nuScenes with its own detectors."
)
MEASURES = (
    "First-sighting recall: share of the objects that newly enter the 50 m around the car that are "
    "detected at their first keyframe (same class, centres within 2 m). Overall recall: of all "
    "object frames within 50 m. TTFD: keyframes from an entry's first sighting to its detection, "
    "censored at 6."
)
WEIGHTS = (
    "Every event weighs the same, and every object frame; with equal scene weights every scene "
    "does. No correction is made for the number of differences in a table."
)
COVERAGE = (
    "On synthetic scenes the intervals over scenes held the truth 93 to 95 times in 100 with 50 "
    "scenes and more, and about 80 times with 5: of fewer than about 20 scenes they are too narrow."
)
PROTOCOL_CAPTION = " ".join([READING, MEASURES, WEIGHTS, COVERAGE])
