"""`care-sim view`: the Rerun viewer over a recording, on this machine or in a browser, without a
network.
"""

import os
import signal
import socket
import subprocess
import sys
from urllib.parse import quote

from care_sim.base.errors import InvalidInput
from care_sim.base.extras import import_rerun
from care_sim.base.files import RERUN
from care_sim.base.interrupts import FAILED
from care_sim.commands.options.watching import View

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
