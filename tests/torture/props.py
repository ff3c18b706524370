"""Things that lie about in the folder of a case: small results, recordings, weights, and what is no
file at all.

Templates are made once, by the program itself, and copied where a case wants them.
"""

import os
import shutil
import stat
import time
import traceback
from concurrent.futures import Executor, Future
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path

from tests.torture.case import words

PLAYS_S = 1.0
"""So long an executor of this process plays; then it is as if somebody pressed Ctrl-C."""


class Inline(Executor):
    """Plays in this process, so that limits hold and thousands of cases are quick."""

    def __init__(self, seconds, *_, **__):
        self._until = time.monotonic() + seconds

    def submit(self, fn, /, *args, **kwargs):
        if time.monotonic() > self._until:
            raise KeyboardInterrupt
        future = Future()
        future.set_running_or_notify_cancel()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


@contextmanager
def inline(seconds=PLAYS_S):
    """Studies play in this process, for so long."""
    from care_sim.certify.playing import trails_of
    from care_sim.reports.page.build import write_page
    from care_sim.study import executors

    usual = executors.processes
    defaults = {made: made.__defaults__ for made in (write_page, trails_of)}
    executors.processes = own = partial(Inline, seconds)
    for made, values in defaults.items():
        made.__defaults__ = tuple(own if value is usual else value for value in values)
    try:
        yield
    finally:
        executors.processes = usual
        for made, values in defaults.items():
            made.__defaults__ = values


def care_sim(*arguments):
    """Run a command here and now, for a template; what it says. Its exit code must be 0."""
    from care_sim.cli import main

    said = StringIO()
    with inline(float("inf")), redirect_stdout(said), redirect_stderr(said):
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as end:
            if end.code:
                raise RuntimeError(f"{arguments}: {said.getvalue()}") from end
    return said.getvalue()


def template(name):
    """The template of that name, made once by the function of the name below; in a process of its
    own, since Rerun makes no recording in a fork of a process that has made one.
    """
    path = Path(os.environ["TORTURE_FOLDER"]) / "templates" / name
    if path.exists():
        return path
    path.parent.mkdir(exist_ok=True)
    if not (child := os.fork()):
        try:
            os.chdir(path.parent)
            _log(name, path) if name in LOGS else globals()[f"_make_{name}"](path)
        except BaseException:
            traceback.print_exc()
            os._exit(1)
        os._exit(0)
    if os.waitpid(child, 0)[1]:
        raise RuntimeError(f"no template {name}")
    return path


def copy(name, to):
    """A copy of a template."""
    source = template(name)
    return Path(shutil.copytree(source, to) if source.is_dir() else shutil.copy(source, to))


SWEEP = ("sweep", "--scenarios", "dartout", "--policies", "history", "care", "--workers", "1")
SHORT = ("--scenario-parameters", "duration_s=0.2")


def _make_results(path):
    care_sim(*SWEEP, "--seeds", "2", *SHORT, "--out", path)


def _make_protocol(path):
    source = f"argoverse2:{template('drive')}"
    options = words("--policies care history full --budgets 0.1 --floor-seeds 1 --workers 1")
    care_sim("protocol", "--source", source, *options, "--out", path)


LOGS = ("npy", "csv", "headless", "ascii", "binary", "kitti", "nuscenes")
"""Logs without labels, by the form of their sweeps."""


def _make_drive(path):
    from tests.helpers.av2_log import at, box, write

    def seen(sweep):
        ahead = 20.0 - 0.5 * sweep
        boxes = [
            box("BOX_TRUCK", (ahead, -4.0, 0.9), (6.0, 2.2, 2.6), track="van"),
            box("REGULAR_VEHICLE", (ahead + 9.0, 3.5, 0.42), track="car"),
        ]
        person = box("PEDESTRIAN", (ahead + 6.0, 5.0, 0.6), (0.6, 0.7, 1.8), track="person")
        return [*boxes, person] if sweep >= 5 else boxes

    write(path, [seen(n) for n in range(15)], [at(0.5 * n) for n in range(15)])


def _make_base(path):
    from tests.helpers.nuscenes_database import write
    from tests.helpers.nuscenes_drive import samples

    write(path, {"scene-0103": samples(0.0)[:3]})


def _log(form, path):
    from tests.helpers.sweeps_log import write_log

    write_log(path, form, seconds=1.2)


def _make_bag(path):
    from tests.helpers.sweeps_bag import write_bag

    write_bag(path)


def _make_scorer(path):
    from care_sim.policies.learned.weights import shipped_weights

    shutil.copy(shipped_weights("learned-scorer"), path)


def _make_ppo(path):
    from care_sim.policies.learned.weights import shipped_weights

    shutil.copy(shipped_weights("ppo-dense"), path)


def _make_recording(path):
    care_sim("run", "dartout", *SHORT, "--record", path.with_suffix(".rrd"))
    path.with_suffix(".rrd").rename(path)


def _make_trained(path):
    """The input of `train curves`, as `train ppo` leaves it."""
    from care_sim.training.config import PpoConfig

    path.mkdir()
    (path / "config.json").write_text(PpoConfig().to_json())
    played = (("random", 0), ("care", 0), ("full", 0), ("learner", 0), ("learner", 64))
    (path / "episodes.csv").write_text(
        "policy,steps,seed,env,return,distance_m\n"
        + "".join(f"{name},{steps},2000,CARE-Dense-v0,-3.0,12.0\n" for name, steps in played)
    )
    (path / "curve.csv").write_text(
        "steps,seconds,return,distance_m\n0,0.1,-5.0,8.0\n64,1.5,-4.0,9.5\n"
    )


def lay_out(names, folder):
    """Put what the names ask for into a folder: first parts of paths."""
    for name in set(names):
        place = folder / name
        if name in ("results", "drive", "base"):
            copy(name, place)
        elif name in _ODD:
            _ODD[name](place)


def _device(minor):
    def make(path):
        try:
            os.mknod(path, 0o666 | stat.S_IFCHR, os.makedev(1, minor))
        except OSError:
            path.symlink_to(f"/dev/{ {3: 'null', 5: 'zero', 7: 'full'}[minor] }")

    return make


def _locked(path):
    path.mkdir(mode=0o500)


_ODD = {
    "empty": Path.mkdir,
    "text": lambda path: path.write_text("hello\n"),
    "link": lambda path: path.symlink_to("text-behind-a-link"),
    "broken-link": lambda path: path.symlink_to("nowhere/at/all"),
    "loop": lambda path: path.symlink_to("loop"),
    "null": _device(3),
    "zero": _device(5),
    "full": _device(7),
    "pipe": os.mkfifo,
    "locked": _locked,
}


def _make_undisturbed(path):
    from tests.torture import study

    care_sim(*study.command(path, workers=1))
