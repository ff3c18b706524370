"""Readings of rows: their setting, their policy, and in the closed loop their first detection.

Rows of one world under the same conditions can be compared and form a `Setting`, in the closed and
in the open loop. In a setting, the rows of a policy at a budget form a cell. Some columns are added
when a study is written: they need several rows, or the policies.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from typing import Any

from care_sim.base.checks import is_number
from care_sim.core.conditions import CAMERA_FAULTS, DEFAULTS, OF_BOTH_LOOPS, UNUSED_BY_FULL_SCAN
from care_sim.evaluation.censoring import Reading
from care_sim.evaluation.sightings import ANNOTATED
from care_sim.perception.detectors import CLUSTER, PROXY
from care_sim.policies import tags_of
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.run_config import Row

ChangedConditions = tuple[tuple[str, Any], ...]
"""Names and values of the conditions that are not the default."""
SOURCES = {
    "streets": "generated streets",
    "argoverse2": "Argoverse 2",
    "nuscenes": "nuScenes",
    "kitti": "KITTI",
    "boreas": "Boreas",
}
"""Names of film sources in headings."""
WITHOUT_LABELS = "sweeps"
"""The source that a detector annotates."""


@dataclass(frozen=True, order=True)
class Setting:
    """The world of rows, and their conditions other than the defaults.

    `world` is a scenario in the closed loop and a source of films in the open loop. `detector` is
    that of the open loop with its parameters. It is empty in the closed loop, where a non-default
    detector is a condition.
    """

    world: str
    conditions: ChangedConditions = ()
    detector: str = ""

    @property
    def faults(self) -> bool:
        """True if the camera is impaired."""
        return any(name in CAMERA_FAULTS for name, _ in self.conditions)

    @property
    def strict_causal(self) -> bool:
        """True for the paper's strict-causal variant (Sec. 3): the camera one keyframe old.

        The paper defines it only in the open loop.
        """
        # Only the open loop has a detector here.
        return bool(self.detector) and self.conditions == (("camera_latency", 1),)

    @property
    def has_paper(self) -> bool:
        """True if the paper's figures apply to these films: generated streets and recordings, but
        not a user's source.
        """
        return self.world in SOURCES

    @property
    def as_in_paper(self) -> bool:
        """True if the paper's figures apply and all conditions are defaults."""
        return self.has_paper and not self.conditions

    @property
    def label(self) -> str:
        """A heading."""
        changed = [f"{name.replace('_', ' ')} {value}" for name, value in self.conditions]
        if self.strict_causal:
            changed = ["strict-causal (camera one keyframe old)"]
        if not self.detector:
            return ", ".join([self.world, *changed])
        return ", ".join(
            [SOURCES.get(self.world, self.world), f"detector {self.detector}", *changed]
        )

    @property
    def slug(self) -> str:
        """A part of a file's name, beginning with the world."""
        detector = [] if self.detector in ("", PROXY) else [self.detector]
        changed = [f"{name}-{value}" for name, value in self.conditions]
        text = "-".join([self.world, *detector, *changed])
        # Other characters may have a meaning for a file system or a shell.
        return "".join(sign if sign.isalnum() or sign in ".-" else "-" for sign in text)

    def for_full(self) -> "Setting":
        """Return the setting of the full scan of the same world."""
        felt = (pair for pair in self.conditions if pair[0] not in UNUSED_BY_FULL_SCAN)
        return replace(self, conditions=tuple(felt))


_OF_A_SETTING = {*DEFAULTS, "scenario", "sensor", "sensor_hash", "detector", "keyframe_s"}
_USUAL_EPISODE = {field.name: field.default for field in fields(EpisodeConfig)}
READ_WITH = {
    "camera_detections": None,
    "sweeps": 1,
    "camera_times": None,
    "empty_boxes": None,
    "points": None,
    "reference": CLUSTER,
    "topics": None,
}
"""Columns of the reading of a recording, and their usual values."""
_USUAL_PLAY = (
    {name: DEFAULTS[name] for name in OF_BOTH_LOOPS if name != "floor_seed"}
    | READ_WITH
    | {"presence": ANNOTATED}
)


Key = tuple[Setting, str, float]
"""Setting, policy with its parameters, budget."""


def setting_of(row: Row) -> Setting:
    """The setting of a row, of an episode or of a play in the open loop."""
    if "source" in row:
        return _setting_of_play(row)
    # Thousands of rows share their columns, and their setting.
    names = _setting_columns(tuple(row))
    return _setting_with(names, *[row[name] for name in names])


@lru_cache
def _setting_columns(names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the columns that name a setting."""
    return tuple(n for n in names if n in _OF_A_SETTING or n.startswith(("scenario.", "detector.")))


# Typed, since 1, 1.0 and True are equal but written differently.
@lru_cache(typed=True)
def _setting_with(names: tuple[str, ...], *values: Any) -> Setting:
    """Return the setting of rows that hold these values."""
    row = dict(zip(names, values, strict=True))
    # Parameters of a scenario have no default in _USUAL_EPISODE: a given one makes another setting,
    # for any value.
    changed = [
        (n, value)
        for n, value in row.items()
        if (n in DEFAULTS or n.startswith("scenario."))
        and value is not None
        and value != _USUAL_EPISODE.get(n)
    ]
    # Sorted, so that the order of columns in a file does not matter.
    conditions = sorted((n.removeprefix("scenario."), v) for n, v in changed)
    conditions += _sensor(row)
    if row.get("keyframe_s") is not None:
        conditions.append(("keyframe_s", row["keyframe_s"]))
    if row.get("detector") is not None:
        conditions.append(("detector", with_parameters(row, "detector")))
    return Setting(row["scenario"], tuple(conditions))


def _setting_of_play(row: Row) -> Setting:
    """A condition for which the row has no column is the default."""
    # Files of older versions have no columns for the conditions that were added since.
    changed = tuple(
        (name, row[name])
        for name, usual in _USUAL_PLAY.items()
        if row.get(name) not in (usual, None)
    )
    return Setting(row["source"], (*changed, *_sensor(row)), with_parameters(row, "detector"))


def _sensor(row: Row) -> list[tuple[str, Any]]:
    """Return a non-default sensor set-up, as a condition. Files of one name may differ, so the
    beginning of the hash is included.
    """
    if row.get("sensor") is None:
        return []
    digest = row.get("sensor_hash") or "of no hash"
    return [("sensor", f"{row['sensor']} {digest[:6]}")]


def key_of(row: Row) -> Key:
    """Return the cell of a row."""
    return setting_of(row), policy_of(row), row["budget"]


def policy_of(row: Row) -> str:
    """The policy with its parameters."""
    return with_parameters(row, "policy")


def with_parameters(row: Row, kind: str) -> str:
    """Return the name in the column `kind`, with the parameters in the columns `kind.NAME`."""
    given = [(name, row[name]) for name in _parameter_columns(tuple(row), f"{kind}.")]
    return " ".join(
        [
            row[kind],
            *(
                f"{name.removeprefix(f'{kind}.')}={_text(value)}"
                for name, value in given
                if value is not None
            ),
        ]
    )


@lru_cache
def _parameter_columns(names: tuple[str, ...], prefix: str) -> tuple[str, ...]:
    return tuple(name for name in names if name.startswith(prefix))


def _text(value: Any) -> str:
    """Written the same for an int and for the float that a file holds."""
    return f"{value:g}" if is_number(value) else f"{value}"


def tags_of_row(row: Row) -> tuple[str, ...]:
    """Tags of the row's policy, such as privileged; none in a row that was not annotated."""
    return tuple((row.get("tags") or "").split("+"))


def grouped(rows: Sequence[Row]) -> dict[Key, list[Row]]:
    """The rows of every cell, in the order of their first rows."""
    groups: dict[Key, list[Row]] = {}
    for row in rows:
        groups.setdefault(key_of(row), []).append(row)
    return groups


def detection(row: Row) -> Reading | None:
    """Return the detection distance in metres, for an undetected actor its upper bound. None for an
    episode without a first-sighting actor.

    A detection after a needless stop does not count: the distance is then the upper bound.
    """
    distance = row["detection_distance_m"]
    if distance is not None:
        return Reading(float(distance), censored=stops_for_nothing(row))
    most = row["undetected_to_m"]
    return None if most is None else Reading(float(most), censored=True)


def detections(rows: Sequence[Row]) -> list[Reading]:
    """Return the first detections of all rows that have a first-sighting actor."""
    return [found for found in map(detection, rows) if found is not None]


def is_missed(row: Row) -> bool:
    """Return True if there was a first-sighting actor that was never detected."""
    found = detection(row)
    return found is not None and found.censored


def stops_for_nothing(row: Row) -> bool:
    """Return True if the car braked for a false detection, before the actor was in view. Older
    files, and plays of the open loop, lack the column.
    """
    return bool(row.get("braked_before_view"))


def is_avoided(row: Row) -> bool:
    """Return True if the car avoids the collision. A needless stop avoids none."""
    return not (row["collision"] or stops_for_nothing(row))


def spared_seeds(full: Sequence[Row]) -> set[int]:
    """Return the seeds on which the full scan avoids the collision."""
    return {row["seed"] for row in full if is_avoided(row)}


def preventable(full: Sequence[Row], rows: Sequence[Row]) -> list[Row]:
    """Return the rows of the seeds on which the full scan avoids the collision."""
    spared = spared_seeds(full)
    return [row for row in rows if row["seed"] in spared]


_FullScans = dict[tuple[Setting, int], Row]


def with_added_columns(rows: Sequence[Row]) -> list[Row]:
    """Return the rows with three more columns: `tags` of the policy, joined by '+', and those of
    `with_regret`.
    """
    return with_regret(with_tags(rows))


def with_regret(rows: Sequence[Row]) -> list[Row]:
    """Return the rows with two more columns, which replace existing ones.

    `regret_m` is the detection distance of the full scan in the same world and seed minus that of
    this row, 0 at best. It is None without a full scan or an actor. `censored` is True if the
    policy or the full scan never detected the actor. Then `regret_m` uses the upper bound of a
    distance and is a bound.
    """
    full = {(setting_of(row), row["seed"]): row for row in rows if row["policy"] == "full"}
    return [{**row, **_regret(row, full)} for row in rows]


def with_tags(rows: Sequence[Row]) -> list[Row]:
    """The rows with the column `tags`."""
    return [{**row, "tags": "+".join(tags_of(row["policy"]))} for row in rows]


def _regret(row: Row, full: _FullScans) -> Row:
    bound = full.get((setting_of(row).for_full(), row["seed"]))
    ours, theirs = detection(row), detection(bound) if bound else None
    if ours is None or theirs is None:
        return {"regret_m": None, "censored": is_missed(row)}
    return {"regret_m": theirs.value - ours.value, "censored": ours.censored or theirs.censored}
