"""How to read the tables of a study: of episodes of the closed loop, of the protocol of the open
loop, and of its mechanism. A remark on a column or a mark stands only where tables show it.
"""

from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

from care_sim.reports.contrasts import GATE_COLLISION_POINTS, GATE_M, GATE_POINTS
from care_sim.reports.protocol.differences import OVER_EVENTS
from care_sim.reports.protocol.formatting import PAPER
from care_sim.reports.table import Bold, Table

_BOLD = "\x02"
"""Stands for bold type among what tables show; no text of a table holds a control code."""


class Remark(NamedTuple):
    """A part of a caption, and the words or marks of which tables must show one for it to stand;
    without any it always does.
    """

    text: str
    about: tuple[str, ...] = ()


def caption(remarks: Sequence[Remark], tables: Sequence[Table]) -> str:
    """The remarks that these tables need."""
    lines = chain.from_iterable(((table.title,), table.columns, *table.rows) for table in tables)
    texts = [*chain(*lines)]
    shown = " ".join(texts) + (_BOLD if any(isinstance(text, Bold) for text in texts) else "")
    return " ".join(
        remark.text
        for remark in remarks
        if not remark.about or any(mark in shown for mark in remark.about)
    )


# How censored distances enter each statistic is decided in care_sim.evaluation.censoring.
_EPISODES_READING = (
    Remark(
        "First detection: planar distance in metres from the sensor to the first-sighting actor at "
        "the first keyframe it is detected; median [quartiles]. k/n: k of n episodes, one a seed. "
        "An actor that was never detected is neither a zero nor left out."
    ),
    Remark("Never: how many they are.", ("never",)),
    Remark(
        "Its detection distance is at most that of the nearest scan that passed it by, and at "
        "least 0. In medians and quartiles it ranks below every detection."
    ),
    Remark(
        "One that falls on such episodes, or between them and a detection, reads 'not detected' "
        "(n.d.).",
        ("not detected", "n.d."),
    ),
    Remark(
        "In differences it enters at that most, which favours the policy that missed; the "
        "difference is then a bound. ≤: the true difference is at most what is printed; ≥: at "
        "least; ~: both sides missed actors, and it may lie on either side.",
        ("≤", "≥", "~"),
    ),
    Remark("Pass: least distance of the centres, median, once the actor is in view.", ("pass",)),
    Remark("Clearance: least distance hull to hull, median, once in view.", ("clearance",)),
    Remark(
        "Regret: first detection of the full scan of the same world minus this policy's, mean in "
        "metres, 0 at best, and its interval; as full: episodes in which the policy detects no "
        "later.",
        ("regret",),
    ),
)


# The resampling is in care_sim.evaluation.bootstrap, the gates in care_sim.reports.contrasts.
def _statistics(points: str) -> tuple[Remark, ...]:
    """How differences are made, and the gate of those that are in `points`."""
    return (
        Remark(
            "Differences are means, paired by seed (common random numbers), with 95% percentile "
            "bootstrap intervals of 10,000 resamples; positive favours the first named."
        ),
        Remark(
            "Bold differences: the interval excludes zero wherever in their range the censored "
            "distances lie, on five or more seeds.",
            (_BOLD,),
        ),
        Remark(
            "Asterisk: it does, and the mean reaches the gate stated in advance: "
            f"{GATE_M} m of first detection (the road covered at 30 km/h while the brake builds "
            f"up, 0.3 s) or {points}.",
            ("*",),
        ),
    )


_OF_RATES = _statistics(f"{GATE_POINTS:.0f} points of a rate")
_OF_COLLISIONS = _statistics(
    f"{GATE_COLLISION_POINTS:.0f} points of the collisions that the full scan avoids on the same "
    "seed"
)
# Measured again by tests/evaluation/test_bootstrap.py.
_EPISODES_COVERAGE = (
    Remark(
        "No correction is made for the number of differences in a table. Distances come in steps "
        "of the road that is covered between two keyframes, 0.8 m at 30 km/h. How often the "
        "intervals hold the truth was measured on synthetic differences: of 30 seeds, 90 to 96 "
        "times in 100; of 5 seeds, only about 80 times, and about 40 times where one episode in "
        "ten differs and most sets of five show no difference at all. An interval without width "
        "says that all seeds differ alike, not that the estimate is exact."
    ),
)
_SWEEP_COLLISIONS = (
    Remark(
        "Preventable: differences on the seeds on which the full scan collides with nobody.",
        ("Preventable collisions",),
    ),
    Remark(
        f"The gate of collisions is {GATE_COLLISION_POINTS:.0f} points.", ("ollisions avoided",)
    ),
)
EPISODES_CAPTION = (*_EPISODES_READING, *_OF_RATES, *_SWEEP_COLLISIONS, *_EPISODES_COVERAGE)
VALIDATION_CAPTION = (*_EPISODES_READING, *_OF_COLLISIONS, *_EPISODES_COVERAGE)
VEHICLE_CAPTION = (
    Remark(
        "A cell of policies: median first detection in metres, and how many of the episodes ended "
        "with a collision. Where some episodes met nobody, the number after the median is that of "
        "the others. NCAP turns are paired by case and seed, and resampled by case, each with its "
        "mean over the seeds."
    ),
    *_EPISODES_READING,
    *_statistics(f"{GATE_COLLISION_POINTS:.0f} points of collisions avoided"),
    *_EPISODES_COVERAGE,
)
# The verdicts are in care_sim.reports.realism.orders.
_VERDICTS = (
    Remark(
        "Orders: the first policy minus the second; positive where the first detects earlier, "
        "avoids or finds more. Beside the difference stands what becomes of the order under ideal "
        "conditions: it holds (both intervals lie on one side of zero), is lost (the interval "
        "holds zero, or may where actors were missed) or flips (it lies on the other side). Of two "
        "that are not told apart under ideal conditions: tied (here neither), or a lead arises. No "
        "verdict of fewer than five pairs.",
        (" orders ",),
    ),
)
REALISM_CAPTION = (
    *_VERDICTS,
    Remark(
        "Euro NCAP tests and drives: points and counts of collisions avoided. Of the former the "
        "tests are what is paired, each with its mean over the seeds."
    ),
    *_EPISODES_READING,
    *_statistics(f"{GATE_COLLISION_POINTS:.0f} points of collisions avoided"),
    *_EPISODES_COVERAGE,
)
# The classes are in care_sim.evaluation.collision_outcomes, the mark in care_sim.scenarios.r157.
R157_CAPTION = (
    Remark(
        "A cut-in is preventable where a car that never brakes is touched and the careful human "
        "driver of UN Regulation 157 is not; only these are played. Avoided: nothing was touched; "
        "mitigated: touched, the car more than 1 km/h slower than it came; hit: touched at that "
        "speed. Impact: the car's speed at the first contact. Differences are points of the cases "
        "avoided, paired by case and seed."
    ),
    *_OF_RATES,
)
NCAP_CAPTION = (
    Remark(
        "Avoided: no contact; mitigated: an impact slower by more than 1 km/h than that of a car "
        "that does not brake; hit: at its speed. Score: 5 without a contact, else "
        "4 max(0, 1 - v_impact / v_reference), "
        "where v_reference is the speed at which a car hits that does not brake (Ljungbergh et al. "
        "2024, NeuroNCAP); on a target that goes ahead at an even speed both are speeds of "
        "closing. A target that was never detected counts by what came of it. In all: the mean of "
        "the tests' scores, each the mean over its speeds and seeds. Reported, unreported: whether "
        "perception reports the cars that hide the target; the same seeds play both. Differences "
        "are paired by seed (common random numbers), with 95% percentile bootstrap intervals of "
        "10,000 resamples; positive favours the policy named. No correction is made for the number "
        "of differences."
    ),
    Remark("Bold: the interval excludes zero, on five or more seeds.", (_BOLD,)),
)
PROTOCOL_CAPTION = (
    Remark(
        "Differences are points of recall, positive where the first named has more, with 95% "
        "intervals of 10,000 paired resamples of scenes."
    ),
    Remark(f"Marked {OVER_EVENTS}: of resamples of events.", (OVER_EVENTS,)),
    Remark("Bold differences: the interval excludes zero.", (_BOLD,)),
    Remark(
        f"{PAPER}: what the paper reports, measured on nuScenes with its own detectors.",
        (PAPER, "(paper:"),
    ),
    Remark(
        "First-sighting recall: share of the objects that newly enter the 50 m around the car that "
        "are detected at their first keyframe (same class, centres within 2 m). Overall recall: of "
        "all object frames within 50 m."
    ),
    Remark(
        "TTFD: keyframes from an entry's first sighting to its detection, censored at 6.",
        ("TTFD",),
    ),
    Remark("Every event weighs the same, and every object frame."),
    Remark("With equal scene weights every scene does.", ("equal scene",)),
    Remark(
        "No correction is made for the number of differences in a table. On synthetic scenes the "
        "intervals over scenes held the truth 93 to 95 times in 100 with 50 scenes and more, and "
        "about 80 times with 5: of fewer than about 20 scenes they are too narrow."
    ),
)
OPEN_REALISM_CAPTION = (*_VERDICTS, *PROTOCOL_CAPTION)
MECHANISM_CAPTION = (
    Remark(
        "On the shared belief one policy drives, and every other is asked at each keyframe what it "
        "would fire there; what happens to an event later is of separate plays. First sightings "
        "are objects that newly enter the 50 m around the car; they are caught where they are "
        "detected at their first keyframe. U and M: wedges of unexplained and explained camera "
        "boxes."
    ),
    Remark(
        "What the paper reports was measured on nuScenes with its own detectors, or on its "
        "vehicle.",
        (PAPER,),
    ),
    Remark(
        "The reasons for a miss are explained in care_sim.evaluation.miss_reasons: every miss has "
        "one, and they add up to the misses.",
        ("missed that the full scan finds",),
    ),
)
