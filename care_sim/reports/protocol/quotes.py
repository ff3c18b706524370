"""Sentences of the paper on its nuScenes evaluation (Secs. 5.2 to 5.4), word for word."""

# Quoted under tables as they stand: nothing here is compared with anything. The numbers in them are
# data in care_sim.reports.protocol.paper.
TABLE_1 = (
    "Table 1: Paired per-scene bootstrap contrasts, in points of recall with 95% confidence "
    "intervals."
)
HISTORY_OVERALL = (
    "Against the history policy, the first-sighting gain is not free at tight budgets: in the "
    "paired per-scene contrast used for all intervals, overall recall moves by -0.8, -0.5, and "
    "+0.6 points at 10%, 20%, and 35%, a budget-dependent Pareto choice that we report as such "
    "rather than as a uniform win."
)
EQUAL_SCENES = (
    "Equal scene weights give 5.3, 5.2, and 4.2 points, so event-rich scenes do not drive it."
)
MEAN_TTFD = (
    "Descriptively, on a single seed CARE lowers the mean censored TTFD of the history policy from "
    "3.76 to 3.64, 3.60 to 3.47, and 3.45 to 3.33 keyframes, a shift of about 0.12 keyframes (60 "
    "ms); no interval claim is made for TTFD."
)
UNCERTAINTY = (
    "It attains the best overall recall of all policies, exceeding CARE by 1.0, 2.2, and 0.5 "
    "points with intervals excluding zero, because it re-examines regions that returned points "
    "without a confident detection."
)
BEAMS = (
    "Beam reduction shows the opposite behavior: its first-sighting recall is statistically tied "
    "with CARE at 20% and 35% and 2.0 points behind at 10%, while it gives up 17.4, 11.5, and 6.4 "
    "points of overall recall (Table 1), so CARE gives the better joint trade-off."
)
CAMERA = (
    "The all-camera control shows that the camera cue, not the history state, drives the "
    "first-sighting gain: the two are tied on first sightings at all three budgets."
)
UNIFORM = (
    "The history+uniform control falls below plain history at every budget, so an undirected "
    "reserve costs more than it returns."
)
ORACLE = (
    "An oracle variant sharpens this point: replacing the forecast of every tracked object with "
    "its true next position, an upper bound on any learned region predictor, moves first-sighting "
    "recall by at most 0.5 points in a single-seed diagnostic run, and every interval contains "
    "zero. Within the same run CARE stays 3.7 to 4.7 points above this oracle, so what it adds is "
    "information about objects that have no track yet, not a better forecast. The oracle raises "
    "overall recall by 0.5 to 0.7 points, as expected from perfect placement on tracked objects."
)
PRIORITY = (
    "Priority ordering is structural: on the full split the variant changes first-sighting recall "
    "by at most 0.2 points, with overall recall of 0.380, 0.418, and 0.457."
)
GUARD = (
    "At the 10% budget, relative to CARE without forgetting, unguarded forgetting loses 1.8 points "
    "of near-field recall on objects within 20 m, interval [-2.9,-0.5], a quarter-scale guard "
    "loses 1.5 points [-2.7,-0.2], and the default shows no significant loss, -0.5 [-1.7,+0.4], "
    "while releasing 24 cells per keyframe. At 20% even the default pays 3.1 points [-4.7,-1.5], "
    "so forgetting is a tool for the tightest budgets."
)
RESERVE = (
    "The reserve fraction needs no tuning: first-sighting recall moves by at most one point across "
    "the swept fractions, since the exploitation cap protects tracked objects and unused reserve "
    "returns to the floor."
)
KNOBS = (
    "The forgetting knobs are insensitive on first sightings: the guard scale, the localization "
    "margin, and the four decay schedules stay within the subset noise, because at urban speeds "
    "the guard of Eq. (3) already covers most nearby objects."
)
MARGIN = (
    "Halving or doubling the angular margin keeps the paired gap between 3.3 and 6.3 points, and "
    "raising the 2D confidence threshold from 0.25 to 0.5 costs one point at the tightest budget "
    "and nothing above; all three sweeps leave the policy ordering unchanged and are descriptive."
)
LEARNED = (
    "The learned scorer matches CARE on first-sighting recall but loses 0.6 to 2.4 points of "
    "overall recall at every budget (Table 1)."
)
DENSE = (
    "In the densest third of the scenes, ranked by tracked-object count, CARE gains 0.7 and 1.0 "
    "points of overall recall over the all-camera reserve at 20% and 35%. The dense-minus-sparse "
    "difference of 0.7 and 1.3 points excludes zero, and the same pattern appears when scenes are "
    "ranked by explained detections instead. Sparse scenes are tied, and the stratified "
    "first-sighting contrasts are tied apart from a 1.3-point loss in the middle third at 20%."
)
CAUSAL = (
    "Delaying the camera detections by one full keyframe, so the reserve only sees half-second-old "
    "evidence, still recovers 4.6, 5.3, and 2.6 points over history: same-frame camera input is "
    "not required."
)
CEILING = (
    "A full scan reaches 0.245 first-sighting and 0.494 overall recall; CARE at 35% recovers 88% "
    "and 94% of these ceilings against 70% and 93% for history, so it closes most of the "
    "allocation-controlled gap."
)
MECHANICAL = (
    "At 10% the unexplained wedges alone fill the reserve on 79% of keyframes, and the realized "
    "allocation changes on only 17% of keyframes, against 68% at 35%."
)
GATE = (
    "The effect-size gate fixed before the runs, five points of first-sighting recall, is met at "
    "10% and 20%; the 35% gain stays positive but below it."
)
