"""How fast a learner goes, and how long the rest should take."""

from care_sim.study.progress import rounded_duration

_LEAST_S = 1.0
"""Seconds of learning from which a rate is told."""


class Pace:
    """Steps a second over whole rounds of acting and learning, the first one left out.

    The first round compiles what is not compiled yet, and a part of a round is acting alone: an
    estimate from either is minutes or hours off. `steps` are those of the whole training.
    """

    def __init__(self, steps: int):
        self._steps = steps
        self._updates: int | None = None
        self._begun: tuple[int, float] | None = None
        self._rate = 0.0

    def told(self, done: int, updates: int, seconds: float) -> str:
        """What to say after so many steps, updates of the network and seconds of learning; empty
        before anything is known.
        """
        # Learners update after acting: where their number grows, a round is over.
        if self._updates is not None and updates > self._updates:
            if self._begun is None:
                self._begun = done, seconds
            elif seconds - self._begun[1] >= _LEAST_S:
                self._rate = (done - self._begun[0]) / (seconds - self._begun[1])
        self._updates = updates
        if not self._rate:
            return ""
        left = rounded_duration(max(self._steps - done, 0) / self._rate)
        return f"{self._rate:.0f} steps/s, {left} left"
