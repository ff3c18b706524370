"""Settle a folder for caches where the user has no home folder, or one that cannot be written.

Numba and Matplotlib keep caches below the home folder. Without one they fail, warn at every
start, or make a folder named `~`. A container that runs under a foreign user number is such a case.
Importing this module settles it.
"""

import os
import stat
import sys
import tempfile
from pathlib import Path

from care_sim.base.interrupts import is_command


def _settle_caches() -> None:
    """Send the caches of this process, and of those that it starts, to a private temporary folder
    where the home folder cannot be written. The command `care-sim` says so in one line.
    """
    given = os.environ.get("MPLCONFIGDIR")
    if given and not _can_be_written(given):
        # Matplotlib would complain with the whole name, and take a new folder at every start.
        del os.environ["MPLCONFIGDIR"]
        if is_command():
            print("care-sim: MPLCONFIGDIR cannot be written, and is ignored", file=sys.stderr)
    home = os.path.expanduser("~")
    has_home = os.path.isabs(home)
    settled = {"XDG_CACHE_HOME", "MPLCONFIGDIR"} <= {*os.environ}
    if has_home and (settled or os.access(home, os.W_OK)):
        return
    try:
        folder = _private_folder()
    except OSError:  # a container whose whole disk is read-only
        folder = Path(os.devnull)
    if not has_home:
        os.environ["HOME"] = str(folder)
    os.environ.setdefault("XDG_CACHE_HOME", str(folder))
    os.environ.setdefault("MPLCONFIGDIR", str(folder / "matplotlib"))
    if is_command():
        print(f"care-sim: no home folder to write to: caches go to {folder}", file=sys.stderr)


def _can_be_written(folder: str) -> bool:
    """Return True if a folder, or the nearest one above it that exists, can be written."""
    path = Path(folder)
    try:
        nearest = next((each for each in (path, *path.parents) if each.exists()), path)
        return nearest.is_dir() and os.access(nearest, os.W_OK)
    except OSError:
        return False


def _private_folder() -> Path:
    """The folder of this user among the temporary files; a new one where somebody else could write
    to it, since caches of Numba hold code. Raises OSError where there is no place for it.
    """
    folder = Path(tempfile.gettempdir()) / f"care-sim-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    is_private = (found.st_uid, stat.S_IMODE(found.st_mode)) == (os.getuid(), 0o700)
    return folder if is_private and stat.S_ISDIR(found.st_mode) else Path(tempfile.mkdtemp())


_settle_caches()
