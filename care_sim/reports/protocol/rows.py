"""The rows of the first-sighting protocol, one per play: for each setting what each policy found in
every scene.
"""

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from care_sim.base.errors import InvalidInput, counted
from care_sim.core.arrays import Floats
from care_sim.core.return_settings import RETURN_SETTINGS
from care_sim.evaluation.allocation_differences import AllocationDifference
from care_sim.evaluation.recall import Tally
from care_sim.evaluation.scene_contrasts import (
    Ratio,
    RatioLevel,
    SceneShare,
    Tallies,
    averaged,
    ratio_level,
    scene_share,
)
from care_sim.evaluation.strata import thirds
from care_sim.study.rows.reading import policy_of, setting_of, tags_of_row
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import FULL, REFERENCE, Row

HISTORY = "history"
"""The policy that every other is compared with."""
_COLUMNS = tuple(field.name for field in fields(Tally))


class SettingPlays:
    """The plays of one setting, floor seeds averaged per scene. Policies are named with their
    parameters.

    `scenes` holds one row of every scene; `full` are the full scans of them, which may come from
    another setting.
    """

    def __init__(self, setting: Setting, rows: Sequence[Row], full: Sequence[Row] = ()):
        self.setting = setting
        self.scenes = {row["scene"]: row for row in rows}
        self.full = tuple(row for row in full if row["scene"] in self.scenes)
        # The full scan feels no budget. It is kept aside as the ceiling of all budgets.
        budgeted = [row for row in rows if row["policy"] != FULL]
        self.tags = {policy_of(row): tags_of_row(row) for row in budgeted}
        self.budgets = sorted({row["budget"] for row in budgeted})
        self._groups: dict[tuple[str, float], list[Row]] = {}
        for row in budgeted:
            self._groups.setdefault((policy_of(row), row["budget"]), []).append(row)
        self._tallies: dict[tuple[str, float, str], Tallies] = {}
        self._strata = _strata_of([*rows, *self.full])

    @property
    def title(self) -> str:
        """The setting and the number of its scenes."""
        return f"{self.setting.label}: {counted(len(self.scenes), 'scene')}"

    @property
    def policies(self) -> tuple[str, ...]:
        """All but the full scan, in the order of their first rows."""
        return tuple(self.tags)

    @property
    def others(self) -> tuple[str, ...]:
        """The policies that the reference is compared with; none where it was not played."""
        return self.other_than(REFERENCE)

    def other_than(self, base: str) -> tuple[str, ...]:
        """All but one and the full scan; none where that one was not played."""
        return tuple(policy for policy in self.tags if policy != base) if base in self.tags else ()

    def rows(self, policy: str, budget: float) -> Sequence[Row]:
        """The plays of a policy; the full scan has one budget."""
        return self.full if policy == FULL else self._groups.get((policy, budget), ())

    def seeds(self, policy: str, budget: float, within: str = "") -> list[Tallies]:
        """The tallies of every floor seed, of all or of one stratum ("range/below 20 m")."""
        seeds: dict[int, dict[str, Tally]] = {}
        for row in self.rows(policy, budget):
            seeds.setdefault(row["floor_seed"], {})[row["scene"]] = _tally(row, within)
        return list(seeds.values())

    def tallies(self, policy: str, budget: float, within: str = "") -> Tallies:
        """The mean tally over floor seeds of every scene that was played with all of them."""
        key = (policy, budget, within)
        # Every table asks for the same tallies again.
        if key not in self._tallies:
            self._tallies[key] = averaged(self.seeds(*key))
        return self._tallies[key]

    def level(self, ratio: Ratio, policy: str, budget: float, within: str = "") -> RatioLevel:
        """A measure over all scenes of the policy."""
        return ratio_level(ratio, self.tallies(policy, budget, within))

    def share_of_full(
        self, ratio: Ratio, policy: str, budget: float, within: str = ""
    ) -> SceneShare | None:
        """A recall in % of the full scan's, of the scenes that both have; None where the full scan
        was not played or found nothing.
        """
        return scene_share(
            ratio, self.tallies(policy, budget, within), self.tallies(FULL, 1.0, within)
        )

    def delays(self, policy: str, budget: float, scene: str) -> Floats:
        """(floor seeds, events) censored TTFD in keyframes of a scene's events."""
        return np.array(
            [row["ttfds"] for row in self.rows(policy, budget) if row["scene"] == scene], float
        )

    def thirds(self, column: str, budget: float) -> dict[str, list[str]]:
        """Scenes ranked by what the reference held there (`tracks`, `explained`), cut in three."""
        return thirds(self.means(column, budget))

    def means(self, column: str, budget: float) -> dict[str, float]:
        """A column of the reference by scene, averaged over floor seeds."""
        values: dict[str, list[float]] = {scene: [] for scene in self.tallies(REFERENCE, budget)}
        for row in self.rows(REFERENCE, budget):
            # A scene that not all floor seeds have played is in no tally, and is left out here too.
            if row["scene"] in values:
                values[row["scene"]].append(row[column])
        return {scene: float(np.mean(seeds)) for scene, seeds in values.items()}

    def allocation_difference(self, policy: str, budget: float) -> AllocationDifference:
        """How its allocations differ from those of the reference, over all plays for which that is
        known.
        """
        columns = ("keyframes", "differing_keyframes", "differing_cells")
        # Not known of the reference itself, of the full scan, and of rows that older versions
        # wrote.
        known = [
            row
            for row in self.rows(policy, budget)
            if None not in (row[column] for column in columns)
        ]
        return AllocationDifference(*(int(sum(row[column] for row in known)) for column in columns))

    def strata(self) -> dict[str, list[str]]:
        """The labels of the strata by kind, of the kinds that all rows have."""
        return self._strata

    def counted(self, ratio: Ratio, within: str = "") -> float:
        """How many events or object frames a measure is of, in all scenes."""
        return sum(ratio.denominator(_tally(row, within)) for row in self.scenes.values())


def plays_by_setting(rows: Sequence[Row]) -> list[SettingPlays]:
    """The plays of every setting in the order of their first rows; the full scan alone makes none
    where others do.

    Raises InvalidInput where the plays of a scene are of two films, or one does not tell the TTFD
    of its events.
    """
    _check_films(rows)
    groups: dict[Setting, list[Row]] = {}
    for row in rows:
        groups.setdefault(setting_of(row), []).append(row)
    full = {
        # Under conditions that the full scan does not feel, it is played once, in the plain
        # setting. Its rows there are the ceiling of this setting too.
        setting: [row for row in own if row["policy"] == FULL]
        for setting, own in groups.items()
    }
    plays = [
        SettingPlays(setting, own, full[setting] or full.get(setting.for_full(), ()))
        for setting, own in groups.items()
    ]
    # The full scans alone are no setting to report, unless nothing else was played.
    return [each for each in plays if each.tags] or plays


def _check_films(rows: Sequence[Row]) -> None:
    """The data of a source may have changed between two runs into one folder."""
    films: dict[tuple[object, ...], str] = {}
    for row in rows:
        # Camera detections from a file, sweeps between keyframes and what becomes of pulses make
        # another film of the scene.
        names = ("camera_detections", "sweeps", "reference", *RETURN_SETTINGS)
        made_with = [row.get(name) for name in names]
        scene = (row["source"], row["scene"], *made_with)
        if len(row["ttfds"]) != row["events"]:
            raise InvalidInput(
                f"a play of scene {row['scene']} has {len(row['ttfds'])} TTFD of {row['events']:g} "
                "events"
            )
        if films.setdefault(scene, row["film_hash"]) != row["film_hash"]:
            raise InvalidInput(
                f"the plays of scene {row['scene']} are of two films: its data changed between "
                "runs; give another --out"
            )


def _tally(row: Row, within: str) -> Tally:
    # Columns of a stratum are named KIND/STRATUM/FIELD, those of all events by the field alone.
    prefix = f"{within}/" if within else ""
    return Tally(*(row[f"{prefix}{column}"] for column in _COLUMNS))


def _strata_of(rows: Sequence[Row]) -> dict[str, list[str]]:
    kinds: dict[str, list[str]] = {}
    for name in rows[0]:
        if name.endswith("/events"):
            kind, label, _ = name.split("/")
            kinds.setdefault(kind, []).append(label)
    # Rows of older versions lack kinds.
    return {
        kind: labels
        for kind, labels in kinds.items()
        if all(f"{kind}/{label}/events" in row for row in rows for label in labels)
    }
