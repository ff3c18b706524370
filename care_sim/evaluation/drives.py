"""The result of a drive, as a pure function of its keyframes and of what it was to meet."""

from collections.abc import Sequence
from dataclasses import asdict

from care_sim.evaluation.metrics import outcome
from care_sim.loops.records import DriveOutcome, EncounterOutcome, Keyframe, Sight
from care_sim.world.motions import Meeting


def drive_outcome(
    keyframes: Sequence[Keyframe], meetings: Sequence[Meeting], progress: float
) -> DriveOutcome:
    """The result of a drive with `meetings`, after a share `progress` of its way."""
    impact = keyframes[-1].impact
    return DriveOutcome(
        **asdict(outcome(keyframes)),
        hit_standing=impact.speed_mps == 0.0 if impact else None,
        needless_braking=sum(record.needless for record in keyframes),
        progress=min(max(progress, 0.0), 1.0),
        encounters=tuple(
            _encounter(
                one,
                [record.sights[number] for record in keyframes],
                impact is not None and impact.body == one.body,
            )
            for number, one in enumerate(meetings)
        ),
    )


def _encounter(meeting: Meeting, sights: Sequence[Sight], hit: bool) -> EncounterOutcome:
    found = next((n for n, sight in enumerate(sights) if sight.detected), None)
    return EncounterOutcome(
        who=meeting.who,
        side=meeting.side,
        along_m=meeting.along_m,
        way=meeting.way,
        course=meeting.course,
        occluder=meeting.occluder,
        occluder_reported=meeting.occluder_reported,
        set_off=bool(meeting.crosser.went),
        view_keyframe=next((n for n, sight in enumerate(sights) if sight.in_view), None),
        detection_keyframe=found,
        detection_distance_m=None if found is None else sights[found].distance_m,
        hit=hit,
    )
