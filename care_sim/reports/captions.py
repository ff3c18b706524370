"""How to read the tables of a study: of episodes of the closed loop, of the protocol of the open
loop, and of its mechanism.
"""

from care_sim.reports.contrasts import GATE_M, GATE_POINTS
from care_sim.reports.protocol.differences import OVER_EVENTS

_READING = (
    "First detection: planar distance in metres from the sensor to the first-sighting actor at the "
    "first keyframe it is detected; median [quartiles]. k/n: k of n episodes, one a seed."
)
# How censored distances enter each statistic is decided in care_sim.evaluation.censoring.
_CENSORING = (
    "An actor that was never detected (counted under 'never') is neither a zero nor left out. Its "
    "detection distance is at most that of the nearest scan that passed it by, and at least 0. In "
    "medians and quartiles it ranks below every detection; one that falls on such episodes, or "
    "between them and a detection, reads 'not detected' (n.d.). In differences it enters at that "
    "most, which favours the policy that missed; the difference is then a bound. ≤: the true "
    "difference is at most what is printed; ≥: at least; ~: both sides missed actors, and it may "
    "lie on either side."
)
_LEVELS = (
    "Pass: least distance of the centres, clearance: hull to hull, both from the moment the actor "
    "is in view; medians. Regret: first detection of the full scan of the same world minus this "
    "policy's, mean in metres, 0 at best, and its interval; as full: episodes in which the policy "
    "detects no later."
)
# The resampling is in care_sim.evaluation.bootstrap, the gates in care_sim.reports.contrasts.
_STATISTICS = (
    "Differences are means, paired by seed (common random numbers), with 95% percentile bootstrap "
    "intervals of 10,000 resamples; positive favours the first named. Bold: the interval excludes "
    "zero wherever in their range the censored distances lie, on five or more seeds. Asterisk: it "
    f"does, and the mean reaches the gate stated in advance: {GATE_M} m of first detection (the "
    f"road covered at 30 km/h while the brake builds up, 0.3 s) or {GATE_POINTS:.0f} points of a "
    "rate. No correction is made for the number of differences in a table."
)
# Measured again by tests/evaluation/test_bootstrap.py.
_COVERAGE = (
    "The ego covers 0.8 m of road a keyframe, so differences come in such steps. How often the "
    "intervals hold the truth was measured on synthetic differences: of 30 seeds, 90 to 96 times "
    "in 100; of 5 seeds, only about 80 times, and about 40 times where one episode in ten differs "
    "and most sets of five show no difference at all. An interval without width says that all "
    "seeds differ alike, not that the estimate is exact."
)
# Studies of differences alone print no levels, and their captions do not explain them.
EPISODES_CAPTION = " ".join([_READING, _CENSORING, _LEVELS, _STATISTICS, _COVERAGE])
DIFFERENCES_CAPTION = " ".join([_READING, _CENSORING, _STATISTICS, _COVERAGE])

_PROTOCOL_READING = (
    "Differences are points of recall (TTFD: keyframes), positive where the first named has more, "
    "with 95% intervals of 10,000 paired resamples of scenes, or of events where marked "
    f"{OVER_EVENTS}; bold: the interval excludes zero. (paper): what the paper reports, measured "
    "on nuScenes with its own detectors."
)
_PROTOCOL_MEASURES = (
    "First-sighting recall: share of the objects that newly enter the 50 m around the car that are "
    "detected at their first keyframe (same class, centres within 2 m). Overall recall: of all "
    "object frames within 50 m. TTFD: keyframes from an entry's first sighting to its detection, "
    "censored at 6."
)
_PROTOCOL_WEIGHTS = (
    "Every event weighs the same, and every object frame; with equal scene weights every scene "
    "does. No correction is made for the number of differences in a table."
)
# Measured again by tests/evaluation/test_bootstrap.py.
_PROTOCOL_COVERAGE = (
    "On synthetic scenes the intervals over scenes held the truth 93 to 95 times in 100 with 50 "
    "scenes and more, and about 80 times with 5: of fewer than about 20 scenes they are too narrow."
)
PROTOCOL_CAPTION = " ".join(
    [_PROTOCOL_READING, _PROTOCOL_MEASURES, _PROTOCOL_WEIGHTS, _PROTOCOL_COVERAGE]
)
MECHANISM_CAPTION = (
    "On the shared belief one policy drives, and every other is asked at each keyframe what it "
    "would fire there; what happens to an event later is of separate plays. First sightings are "
    "objects that newly enter the 50 m around the car; they are caught where they are detected at "
    "their first keyframe. U and M: wedges of unexplained and explained camera boxes. What the "
    "paper reports was measured on nuScenes with its own detectors, or on its vehicle. The reasons "
    "for a miss are explained in care_sim.evaluation.miss_reasons: every miss has one, and they "
    "add up to the misses."
)
NCAP_CAPTION = (
    "Avoided: no contact; mitigated: an impact slower than that of a car that does not brake; hit: "
    "at its speed. Score: 5 without a contact, else 4 max(0, 1 - v_impact / v_reference), where "
    "v_reference is the speed at which a car hits that does not brake (Ljungbergh et al. 2024, "
    "NeuroNCAP); on a target that goes ahead at an even speed both are speeds of closing. A target "
    "that was never detected counts by what came of it. In all: the mean of the tests' scores, "
    "each the mean over its speeds and seeds. Reported, unreported: whether perception reports the "
    "cars that hide the target; the same seeds play both. Differences are paired by seed (common "
    "random numbers), with 95% percentile bootstrap intervals of 10,000 resamples; positive "
    "favours the policy named. Bold: the interval excludes zero, on five or more seeds. No "
    "correction is made for the number of differences."
)
