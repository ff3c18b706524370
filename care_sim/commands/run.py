"""`care-sim run`: one episode, its timeline and its outcome; also of a trained agent."""

import os
import signal
import socket
import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from urllib.parse import quote

from care_sim.base.errors import InvalidInput, report_problems
from care_sim.base.extras import import_rerun
from care_sim.base.files import RERUN
from care_sim.base.interrupts import FAILED
from care_sim.commands.options.watching import Run, View
from care_sim.commands.shared.agent_play import AgentPlay
from care_sim.commands.shared.console import TableConsole
from care_sim.commands.shared.one_scene import finish_files, is_source, maker_of
from care_sim.envs.wrappers.export_scans import ExportScans
from care_sim.envs.wrappers.record_rerun import RecordRerun
from care_sim.policies.base import Policy
from care_sim.reports.episodes.clips import Clip
from care_sim.reports.episodes.photos import Photo
from care_sim.reports.episodes.timeline import episode_timeline, scene_timeline
from care_sim.scenarios import scenario_names
from care_sim.study.episode_play import GymEnv, trace
from care_sim.study.play_config import PlayConfig
from care_sim.study.scene_play import trace_scene
from care_sim.training.agents import find_agent, shipped_agents

_RECORD = Path("runs/run.rrd")
_POLICY, _BUDGET = "care", 0.1
"""The default policy."""


def run(options: Run) -> int:
    """Play one episode and print its timeline and outcome."""
    if options.view:
        import_rerun()
        record = options.record or _RECORD
        record.parent.mkdir(parents=True, exist_ok=True)
        return run(replace(options, view=False, record=record)) or view(View(file=record))
    if _is_agent(options.what):
        options = _agents_run(options)
    elif options.scenario is not None:
        raise InvalidInput("--scenario is for an agent: name the scenario itself")
    policy = options.policy or _POLICY
    asked = _BUDGET if options.budget is None else options.budget
    # Made as a grid of one, the configuration gets what `full` needs, as in a study.
    (config,) = maker_of(options, options.what, [policy], asked)([policy])
    if config.budget != asked:
        print("full fires every cell, whatever the budget", file=sys.stderr)
    photo = Photo(options.picture, options.at)
    film = Clip(options.video, options.video_start)
    watch, wrap = film.episode(policy), partial(_watched, options, photo)
    if isinstance(config, PlayConfig):
        timeline = scene_timeline(config, trace_scene(config, config.film(), watch, wrap=wrap))
    else:
        played = trace(config, watch, wrap=wrap)
        film.show_outcome(played[0])
        timeline = episode_timeline(config, *played)
    timeline.print(TableConsole())
    photo.report()
    finish_files(options.record, film, options.video)
    return 0


def _watched(options: Run, photo: Photo, env: GymEnv, policy: Policy) -> GymEnv:
    """`env`, which is recorded and whose scans are written where files are given."""
    if options.record is not None:
        env = RecordRerun(env, options.record, policy)
    if options.export is not None:
        env = ExportScans(env, options.export, policy)
    return photo.watching(env, policy)


def _is_agent(what: str) -> bool:
    """Whether a text names a trained agent: a shipped one, a folder or file."""
    # Scenarios and sources first: a folder may have the name of one.
    if what in scenario_names() or is_source(what):
        return False
    names = {name for agent in shipped_agents() for name in (agent.name, agent.policy)}
    # A colon is that of a source whose kind is mistyped.
    return what in names or ("/" in what and ":" not in what) or Path(what).exists()


def _agents_run(options: Run) -> Run:
    """The options with which an agent plays where it learned, or in the scenario that they name."""
    if options.policy is not None:
        raise InvalidInput("--policy has no meaning for an agent, which is the policy")
    play = AgentPlay(find_agent(options.what))
    elsewhere = options.scenario is not None
    if not elsewhere and (names := play.left_out()):
        report_problems([f"played without what no command takes: {', '.join(names)}"])
    scene = {} if elsewhere else play.scene
    return replace(
        options,
        what=options.scenario or play.world,
        scenario=None,
        policy=play.agent.policy,
        budget=play.agent.budget if options.budget is None else options.budget,
        **{name: value for name, value in scene.items() if getattr(options, name) is None},
        **play.options(options, only_agent=elsewhere),
    )


_HERE = "127.0.0.1"
_VIEWER = """
import os, signal, sys, threading

def follow():
    os.read(0, 1)
    os.killpg(0, signal.SIGKILL)

threading.Thread(target=follow, daemon=True).start()
from rerun_cli.__main__ import main
sys.exit(main())
"""
"""The viewer's process: Rerun's own launcher, which as a module would not return whether the viewer
failed. Its input is a pipe of this process and ends with it, however that happens: then the viewer
and its children end too.
"""


def view(options: View) -> int:
    """Open the viewer, or serve the recording to browsers."""
    import_rerun()
    if options.file.exists() and not options.file.is_file():
        raise InvalidInput(f"{options.file} is no file, a recording is wanted")
    with options.file.open("rb") as recording:
        if recording.read(len(RERUN)) != RERUN:
            raise InvalidInput(f"{options.file} is no recording of `care-sim run --record`")
    if not options.web:
        if not _rerun(str(options.file), "--port", "auto"):
            return 0
        print(
            "care-sim: the viewer failed; with --web a browser shows the recording",
            file=sys.stderr,
        )
        return FAILED
    # The page of the viewer asks its own server for the data, which has a port of its own.
    data, pages = _free_ports(2)
    source = quote(f"rerun+http://{_HERE}:{data}/proxy", safe="")
    print(
        f"Open http://{_HERE}:{pages}/?hide_welcome_screen&theme=dark&url={source} in a "
        "browser; Ctrl-C ends it.",
        flush=True,
    )
    ports = ("--bind", _HERE, "--port", str(data), "--web-viewer-port", str(pages))
    return _rerun(str(options.file), "--serve-web", *ports)


def _rerun(*options: str) -> int:
    """Run the viewer that comes with Rerun until it ends or is interrupted; none of its processes
    outlives this one.
    """
    # A session of its own makes the viewer and its children one group, which is ended as one.
    quiet = {"RUST_LOG": "warn"} | os.environ
    command = [sys.executable, "-c", _VIEWER, *options]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True, env=quiet)
    try:
        return process.wait()
    except KeyboardInterrupt:
        return 0
    finally:
        _end(process)


def _end(process: "subprocess.Popen[bytes]") -> None:
    try:
        os.killpg(process.pid, signal.SIGTERM)
    except ProcessLookupError:
        return
    process.wait()


def _free_ports(count: int) -> list[int]:
    """Ports of this machine that nobody listens on."""
    # All are held open together: the system would give one port twice.
    sockets = [socket.socket() for _ in range(count)]
    try:
        for one in sockets:
            one.bind((_HERE, 0))
        return [one.getsockname()[1] for one in sockets]
    finally:
        for one in sockets:
            one.close()
