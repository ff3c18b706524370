"""What is common to the commands that play a study of the closed loop, and another of the open loop
where a source of scenes is named.
"""

from collections.abc import Collection
from dataclasses import dataclass, fields

from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.episode_studies import FixedStudy
from care_sim.commands.shared.play_options import SourceOptions, named_after


@dataclass(frozen=True, kw_only=True)
class EitherLoopStudy(FixedStudy, SourceOptions):
    """A study of the closed loop, or with `source` of the open one."""

    source: str | None = None
    """Play the open loop instead, on streets, argoverse2:FOLDER, nuscenes:FOLDER, kitti:FOLDER,
    sweeps:FOLDER, boreas, or a source of your own: the name of an installed one or MODULE:CLASS,
    of recordings with :FOLDER behind it.
    """
    scenes: tuple[str, ...] = ()
    """With --source. One number: that many scenes, from the first. Otherwise names of scenes.
    Without this option, all scenes of the study."""

    def name_of(self, command: str) -> str:
        """What the folder is called where none is given: the kind of source behind the command, as
        in ablate-streets.
        """
        return named_after(command, self.source) if self.source else command

    def check_loop(self, closed: Collection[str], opened: Collection[str]) -> None:
        """Raise InvalidInput for an option of the other loop: those named `closed` have no meaning
        in the open one, those of the source and those named `opened` none in the closed one.
        """
        of_scenes = {"scenes", *(field.name for field in fields(SourceOptions)), *opened}
        foreign, word = (closed, "with") if self.source else (of_scenes, "without")
        for field in fields(self):
            if field.name in foreign and getattr(self, field.name) != field.default:
                option = field.name.replace("_", "-")
                raise InvalidInput(f"--{option} has no meaning {word} --source")
