"""What a command that plays before one's eyes says of the files that it wrote."""

from pathlib import Path

from care_sim.base.errors import print_lines
from care_sim.reports.episodes.clips import Clip


def finish_files(record: Path | None, film: Clip, video: Path | None) -> None:
    """Write the film, and tell of it and of the recording, where there are any."""
    if record is not None:
        print_lines(f"Recorded in {record}: care-sim view {record}")
    if film.write():
        print_lines(f"Filmed in {video}")
