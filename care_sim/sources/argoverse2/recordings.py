"""Folders of Argoverse 2 sensor logs."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from care_sim.base.checks import check_flag, check_known
from care_sim.base.digests import Stamp, file_stamp
from care_sim.base.errors import InvalidInput
from care_sim.loops.film import Film
from care_sim.sources.argoverse2.films import argoverse2_film, logs, sweep_files
from care_sim.sources.argoverse2.tables import POSE_FILE, annotation_file
from care_sim.sources.recordings import Recordings


@dataclass(frozen=True)
class Argoverse2(Recordings):
    """Argoverse 2 sensor logs; a scene is a log. Of a download, those in its folder `split`; in
    `train` and `val` unless it is given. With `empty_boxes` also boxes without a recorded point are
    annotated.
    """

    kind = "argoverse2"
    split: str | None = None
    empty_boxes: bool = False

    def __post_init__(self) -> None:
        check_flag("empty_boxes", self.empty_boxes)

    def scenes(self) -> list[str]:
        """The names of the log folders."""
        return list(self._logs())

    def film(self, scene: str) -> Film:
        """See `care_sim.sources.argoverse2.films.argoverse2_film`."""
        known = self._logs()
        check_known(f"log in {self.folder}", scene, known)
        return argoverse2_film(known[scene], empty_boxes=self.empty_boxes)

    def files(self, scene: str) -> list[Path]:
        """Poses, annotations, and the sweeps where all that the film needs are there."""
        log = self._logs().get(scene, self.folder / scene)
        try:
            tables = (log / POSE_FILE, annotation_file(log))
            return [*tables, *_sweep_files(log, tuple(map(file_stamp, tables)))]
        except InvalidInput:  # `film` refuses the scene
            return [log / POSE_FILE]

    def columns(self) -> dict[str, Any]:
        """Whether boxes without a point are annotated, where they are."""
        return {"empty_boxes": True} if self.empty_boxes else {}

    def _logs(self) -> dict[str, Path]:
        return {log.name: log for log in logs(self.folder, self.split)}


# Tables are read once for all plays of a log, until one of them changes. Sweeps that are added
# later are found in a new process.
@lru_cache(maxsize=1000)
def _sweep_files(log: Path, _stamps: tuple[Stamp, ...]) -> tuple[Path, ...]:
    return tuple(sweep_files(log))
