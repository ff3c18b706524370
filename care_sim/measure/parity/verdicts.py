"""Rays to which two engines give different answers, and why."""

from dataclasses import dataclass

import numpy as np

from care_sim.core.arrays import Integers
from care_sim.core.frames import Frame
from care_sim.core.grid import Cells
from care_sim.measure.parity.answers import Answers, decided_by_a_micrometre, same
from care_sim.sensors.engines import RayEngine

VERDICTS = ("same", "grazing", "lost", "tolerance", "unexplained")
"""Why `fast` differs from a reference, which is Bullet in metres or in millimetres.

Grazing: of rays a micrometre aside, `fast` answers some as the reference did and some as itself.
Lost: not grazing, but the reference answers some rays aside as `fast` did.
Tolerance: not grazing, but Bullet in millimetres sides with `fast`.
Unexplained: none of these.
"""
SAME, GRAZING, LOST, TOLERANCE, UNEXPLAINED = range(5)


@dataclass(frozen=True)
class Engines:
    """The engine in question, the reference, and the reference asked in millimetres, over the same
    bodies.
    """

    fast: RayEngine
    bullet: RayEngine
    exact: RayEngine


@dataclass(frozen=True)
class JudgedRays:
    """Answers to the same rays, and for either reference the verdict (n,) on each ray."""

    fast: Answers
    bullet: Answers
    exact: Answers
    on_bullet: Integers
    on_exact: Integers


def compare(engines: Engines, sensor: Frame, cells: Cells) -> JudgedRays:
    """Cast ascending `cells` with all engines and judge every difference."""
    fast, bullet, exact = (
        engine.cast(sensor, cells) for engine in (engines.fast, engines.bullet, engines.exact)
    )

    # First against Bullet in millimetres, since the second verdict makes use of the first.
    on_exact = np.full(len(cells), SAME)
    on_bullet = np.full(len(cells), SAME)
    for n in np.flatnonzero(~same(fast, exact)).tolist():
        on_exact[n] = _judge(
            engines.fast, engines.exact, sensor, cells[n], _only(fast, n), _only(exact, n)
        )
    for n in np.flatnonzero(~same(fast, bullet)).tolist():
        verdict = _judge(
            engines.fast, engines.bullet, sensor, cells[n], _only(fast, n), _only(bullet, n)
        )
        # Bullet in metres is at fault where Bullet in millimetres answers as `fast` does.
        on_bullet[n] = (
            TOLERANCE if verdict != GRAZING and on_exact[n] in (SAME, GRAZING) else verdict
        )
    return JudgedRays(fast, bullet, exact, on_bullet, on_exact)


def _judge(
    fast: RayEngine,
    reference: RayEngine,
    sensor: Frame,
    cell: int,
    answer: Answers,
    expected: Answers,
) -> int:
    if decided_by_a_micrometre(fast, sensor, cell, expected) and decided_by_a_micrometre(
        fast, sensor, cell, answer
    ):
        return GRAZING
    return LOST if decided_by_a_micrometre(reference, sensor, cell, answer) else UNEXPLAINED


def _only(answers: Answers, number: int) -> Answers:
    return answers[0][[number]], answers[1][[number]]
