"""Rays to which engines give different answers: why, and how many, by what the rays meet."""

from typing import Any, NamedTuple

import numpy as np

from tests.parity.engines import SAME_RANGE_M, decided_by_a_micrometre, same

VERDICTS = ("same", "grazing", "lost", "tolerance", "unexplained")
"""Why `fast` differs from a reference, which is Bullet in metres or in millimetres.

Grazing: of rays a micrometre aside, `fast` answers some as the reference did and some as itself.
Lost: not grazing, but the reference answers some rays aside as `fast` did.
Tolerance: not grazing, but Bullet in millimetres sides with `fast`.
Unexplained: none of these.
"""
SAME, GRAZING, LOST, TOLERANCE, UNEXPLAINED = range(5)
GROUPS = (
    "road or nothing",
    *(f"{family}, {stance}" for family in ("boxes", "round parts", "both")
      for stance in ("upright", "tilted")),
)  # fmt: skip
REFERENCES = ("Bullet", "Bullet in millimetres")
MOST_LISTED = 200
"""Rays that are listed one by one, at the most."""


class JudgedRays(NamedTuple):
    """Answers to the same rays, and for either reference the verdict (n,) on each ray."""

    fast: Any
    bullet: Any
    exact: Any
    on_bullet: np.ndarray
    on_exact: np.ndarray


def compare(engines, sensor, cells):
    """Cast ascending `cells` with all engines and judge every difference."""
    answers = [engine.cast(sensor, cells) for engine in engines]
    on_bullet, on_exact = (
        _verdicts((engines.fast, engine), (answers[0], answer), sensor, cells)
        for engine, answer in zip(engines[1:], answers[1:], strict=True)
    )
    # Bullet in metres is at fault where Bullet in millimetres answers as `fast` does.
    sides = np.isin(on_exact, (SAME, GRAZING)) & ~np.isin(on_bullet, (SAME, GRAZING))
    on_bullet[sides] = TOLERANCE
    return JudgedRays(*answers, on_bullet, on_exact)


def _verdicts(engines, answers, sensor, cells):
    fast, reference = engines
    found = np.full(len(cells), SAME)
    for n in np.flatnonzero(~same(*answers)):
        mine, theirs = ((ranges[[n]], ids[[n]]) for ranges, ids in answers)
        if all(decided_by_a_micrometre(fast, sensor, cells[n], one) for one in (theirs, mine)):
            found[n] = GRAZING
        elif decided_by_a_micrometre(reference, sensor, cells[n], mine):
            found[n] = LOST
        else:
            found[n] = UNEXPLAINED
    return found


def ray_groups(kinds, frames):
    """(n + 2,) places in GROUPS of body ids -1 (nothing), 0 (the road), and 1 to n (`kinds` at
    `frames`).
    """
    places = [0, 0]
    for kind, frame in zip(kinds, frames, strict=True):
        is_round = [part.shape != "box" for part in kind.parts]
        family = 1 if all(is_round) else 2 if any(is_round) else 0
        places.append(1 + 2 * family + (frame.roll != 0 or frame.pitch != 0))
    return np.array(places)


class RayCounts:
    """Verdicts on all rays against both references."""

    def __init__(self):
        shape = (len(REFERENCES), len(GROUPS))
        self.verdicts = np.zeros((*shape, len(VERDICTS)), np.int64)
        self.other_ids, self.other_ranges = np.zeros((2, *shape), np.int64)
        self.widest_m = np.zeros(shape)
        self.listed = []
        self.scans = 0

    def add(self, compared, groups, name):
        """Count the rays of one scan; `name` finds it again, `groups` come from `ray_groups`."""
        self.scans += 1
        ranges, ids = compared.fast
        told = (compared.bullet, compared.on_bullet), (compared.exact, compared.on_exact)
        for reference, ((expected, hit), verdicts) in enumerate(told):
            # A ray counts for the body that `fast` meets, or else for that of the reference.
            met = groups[np.where(ids > 0, ids, hit) + 1]

            # Gaps are those between ranges to one body; inf minus inf would be no number.
            missed = np.isinf(ranges)
            gaps = np.abs(ranges - np.where(missed, 0.0, expected))
            gaps[(ids != hit) | missed] = 0.0
            np.add.at(self.verdicts[reference], (met, verdicts), 1)
            np.add.at(self.other_ids[reference], met, ids != hit)
            np.add.at(self.other_ranges[reference], met, gaps > SAME_RANGE_M)
            np.maximum.at(self.widest_m[reference], met, gaps)

        # Differences that are neither grazing rays nor Bullet's tolerance are listed, for a person
        # to look at.
        strange = np.isin(compared.on_exact, (LOST, UNEXPLAINED)) | (
            compared.on_bullet == UNEXPLAINED
        )
        for n in np.flatnonzero(strange)[: MOST_LISTED - len(self.listed)].tolist():
            body = max(compared.fast[1][n], compared.exact[1][n])
            answers = zip(("fast", "bullet", "exact"), compared[:3], strict=True)
            self.listed.append(
                {**name, "ray": n, "meets": GROUPS[groups[body + 1]]}
                | {engine: _told(*answer, n) for engine, answer in answers}
                | {"on_bullet": VERDICTS[compared.on_bullet[n]]}
                | {"on_exact": VERDICTS[compared.on_exact[n]]}
            )

    def figures(self):
        """For each reference and group the counts, and the rays listed one by one."""
        tables = {
            reference: {group: self._figures(row, place) for place, group in enumerate(GROUPS)}
            for row, reference in enumerate(REFERENCES)
        }
        return {"scans": self.scans, "references": tables, "listed": self.listed}

    def _figures(self, reference, group):
        verdicts = self.verdicts[reference, group].tolist()
        return {
            "rays": sum(verdicts),
            "other_ids": int(self.other_ids[reference, group]),
            "other_ranges": int(self.other_ranges[reference, group]),
            **dict(zip(VERDICTS, verdicts, strict=True)),
            "widest_m": float(self.widest_m[reference, group]),
        }


def _told(ranges, ids, number):
    metres = float(ranges[number])
    return {"body": int(ids[number]), "m": metres if np.isfinite(metres) else None}
