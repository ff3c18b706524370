"""Counts of verdicts, by what the rays meet."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from care_sim.core.frames import Frame, Integers
from care_sim.measure.parity.answers import SAME_RANGE_M, Answers
from care_sim.measure.parity.verdicts import LOST, UNEXPLAINED, VERDICTS, Compared
from care_sim.world.bodies import BodyKind

FAMILIES = ("boxes", "round parts", "both")
GROUPS = (
    "road or nothing",
    *(f"{family}, {stance}" for family in FAMILIES for stance in ("upright", "tilted")),
)
REFERENCES = ("Bullet", "Bullet in millimetres")
LISTED_AT_MOST = 200
"""Rays that are listed one by one."""


def groups(kinds: Sequence[BodyKind], frames: Sequence[Frame]) -> Integers:
    """(n + 2,) places in GROUPS of body ids -1 (nothing), 0 (the road), and 1 to n (`kinds` at
    `frames`).
    """
    pairs = zip(kinds, frames, strict=True)
    return np.array(
        [
            0,
            0,
            *(
                1 + 2 * _family(kind) + (frame.roll != 0 or frame.pitch != 0)
                for kind, frame in pairs
            ),
        ]
    )


def _family(kind: BodyKind) -> int:
    round_parts = [part.shape != "box" for part in kind.parts]
    return 1 if all(round_parts) else 2 if any(round_parts) else 0


class AgreementCounts:
    """Verdicts on all rays against both references."""

    def __init__(self) -> None:
        shape = len(REFERENCES), len(GROUPS)
        self.verdicts = np.zeros((*shape, len(VERDICTS)), np.int64)
        self.other_ids, self.other_ranges = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
        self.widest_m = np.zeros(shape)
        self.listed: list[dict[str, Any]] = []
        self.scans = 0

    def add(self, compared: Compared, groups: Integers, name: dict[str, Any]) -> None:
        """Take in the rays of one scan; `name` finds it again, `groups` are those of `groups()`."""
        self.scans += 1
        ranges, ids = compared.fast
        pairs = zip(
            (compared.bullet, compared.exact), (compared.on_bullet, compared.on_exact), strict=True
        )
        for reference, ((expected, hit), verdicts) in enumerate(pairs):
            met = groups[np.where(ids > 0, ids, hit) + 1]
            differ = ids != hit
            gaps = np.where(
                differ | np.isinf(ranges),
                0.0,
                np.abs(ranges - np.where(np.isinf(ranges), 0.0, expected)),
            )
            np.add.at(self.verdicts[reference], (met, verdicts), 1)
            np.add.at(self.other_ids[reference], met, differ)
            np.add.at(self.other_ranges[reference], met, gaps > SAME_RANGE_M)
            np.maximum.at(self.widest_m[reference], met, gaps)
        self._list(compared, groups, name)

    def _list(self, compared: Compared, groups: Integers, name: dict[str, Any]) -> None:
        strange = np.isin(compared.on_exact, (LOST, UNEXPLAINED)) | (
            compared.on_bullet == UNEXPLAINED
        )
        for n in np.flatnonzero(strange)[: LISTED_AT_MOST - len(self.listed)].tolist():
            self.listed.append(
                {
                    **name,
                    "ray": n,
                    "meets": GROUPS[groups[max(compared.fast[1][n], compared.exact[1][n]) + 1]],
                    **{
                        key: _told(getattr(compared, key), n) for key in ("fast", "bullet", "exact")
                    },
                    "on_bullet": VERDICTS[compared.on_bullet[n]],
                    "on_exact": VERDICTS[compared.on_exact[n]],
                }
            )

    def figures(self) -> dict[str, Any]:
        """For each reference and group the counts, and the rays listed one by one."""
        tables = {
            name: {group: self._figures(reference, place) for place, group in enumerate(GROUPS)}
            for reference, name in enumerate(REFERENCES)
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
