"""Counts of verdicts, by what the rays meet."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from care_sim.core.arrays import Integers
from care_sim.core.frames import Frame
from care_sim.measure.parity.answers import SAME_RANGE_M, Answers
from care_sim.measure.parity.verdicts import LOST, UNEXPLAINED, VERDICTS, JudgedRays
from care_sim.world.bodies import BodyKind

_FAMILIES = ("boxes", "round parts", "both")
GROUPS = (
    "road or nothing",
    *(f"{family}, {stance}" for family in _FAMILIES for stance in ("upright", "tilted")),
)
REFERENCE_NAMES = ("Bullet", "Bullet in millimetres")
_MOST_LISTED = 200
"""Rays that are listed one by one, at the most."""


def ray_groups(kinds: Sequence[BodyKind], frames: Sequence[Frame]) -> Integers:
    """(n + 2,) places in GROUPS of body ids -1 (nothing), 0 (the road), and 1 to n (`kinds` at
    `frames`).
    """
    places = [0, 0]
    for kind, frame in zip(kinds, frames, strict=True):
        tilted = frame.roll != 0 or frame.pitch != 0
        places.append(1 + 2 * _family(kind) + tilted)
    return np.array(places)


def _family(kind: BodyKind) -> int:
    """A place in _FAMILIES."""
    round_parts = [part.shape != "box" for part in kind.parts]
    return 1 if all(round_parts) else 2 if any(round_parts) else 0


class AgreementCounts:
    """Verdicts on all rays against both references."""

    def __init__(self) -> None:
        shape = (len(REFERENCE_NAMES), len(GROUPS))
        self.verdicts = np.zeros((*shape, len(VERDICTS)), np.int64)
        self.other_ids = np.zeros(shape, np.int64)
        self.other_ranges = np.zeros(shape, np.int64)
        self.widest_m = np.zeros(shape)
        self.listed: list[dict[str, Any]] = []
        self.scans = 0

    def add(self, compared: JudgedRays, groups: Integers, name: dict[str, Any]) -> None:
        """Count the rays of one scan; `name` finds it again, `groups` come from `ray_groups`."""
        self.scans += 1
        ranges, ids = compared.fast
        pairs = zip(
            (compared.bullet, compared.exact), (compared.on_bullet, compared.on_exact), strict=True
        )
        for reference, ((expected, hit), verdicts) in enumerate(pairs):
            # A ray counts for the body that `fast` meets, or else for that of the reference.
            met = groups[np.where(ids > 0, ids, hit) + 1]

            # Gaps are those between ranges to one body; inf minus inf would be no number.
            differ = ids != hit
            missed = np.isinf(ranges)
            gaps = np.where(differ | missed, 0.0, np.abs(ranges - np.where(missed, 0.0, expected)))
            np.add.at(self.verdicts[reference], (met, verdicts), 1)
            np.add.at(self.other_ids[reference], met, differ)
            np.add.at(self.other_ranges[reference], met, gaps > SAME_RANGE_M)
            np.maximum.at(self.widest_m[reference], met, gaps)
        self._list(compared, groups, name)

    def _list(self, compared: JudgedRays, groups: Integers, name: dict[str, Any]) -> None:
        # What neither grazes nor is Bullet's tolerance is listed, for a person to look at.
        strange = np.isin(compared.on_exact, (LOST, UNEXPLAINED)) | (
            compared.on_bullet == UNEXPLAINED
        )
        for n in np.flatnonzero(strange)[: _MOST_LISTED - len(self.listed)].tolist():
            self.listed.append(
                {
                    **name,
                    "ray": n,
                    "meets": GROUPS[groups[max(compared.fast[1][n], compared.exact[1][n]) + 1]],
                    "fast": _told(compared.fast, n),
                    "bullet": _told(compared.bullet, n),
                    "exact": _told(compared.exact, n),
                    "on_bullet": VERDICTS[compared.on_bullet[n]],
                    "on_exact": VERDICTS[compared.on_exact[n]],
                }
            )

    def figures(self) -> dict[str, Any]:
        """For each reference and group the counts, and the rays listed one by one."""
        tables = {
            name: {group: self._figures(reference, place) for place, group in enumerate(GROUPS)}
            for reference, name in enumerate(REFERENCE_NAMES)
        }
        return {"scans": self.scans, "references": tables, "listed": self.listed}

    def _figures(self, reference: int, group: int) -> dict[str, float]:
        verdicts = self.verdicts[reference, group]
        return {
            "rays": int(verdicts.sum()),
            "other_ids": int(self.other_ids[reference, group]),
            "other_ranges": int(self.other_ranges[reference, group]),
            **dict(zip(VERDICTS, verdicts.tolist(), strict=True)),
            "widest_m": float(self.widest_m[reference, group]),
        }


def _told(answers: Answers, number: int) -> dict[str, float | None]:
    metres = float(answers[0][number])
    return {"body": int(answers[1][number]), "m": metres if np.isfinite(metres) else None}
