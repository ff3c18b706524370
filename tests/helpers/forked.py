"""Python code in processes of its own, which need not import the libraries anew: they are forked
from one that has imported them, and nothing of CARE-Sim.
"""

import json
import os
import subprocess
import sys
from typing import NamedTuple

from tests.helpers.places import ROOT

LIBRARIES = (
    "gymnasium",
    "highway_env.envs",
    "matplotlib.pyplot",
    "numba",
    "pandas",
    "pyarrow.parquet",
    "pybullet",
    "rich.console",
    "scipy.spatial.transform",
    "scipy.stats",
    "tyro",
)
LEARNING = ("torch", "stable_baselines3")
SERVER = """
import gc, importlib, json, os, sys

for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
    except ImportError:
        pass
gc.collect()
gc.freeze()
for line in sys.stdin:
    asked = json.loads(line)
    child = os.fork()
    if child == 0:
        break
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
else:
    os._exit(0)
for number, path in enumerate((os.devnull, asked["out"], asked["err"])):
    os.dup2(os.open(path, os.O_RDWR | os.O_CREAT), number)
os.chdir(asked["folder"])
sys.argv = ["-c"]
# The code is the main program: its classes are to be found there by whoever unpickles them.
__code__ = compile(asked["code"], "<string>", "exec")
for name in [name for name in globals() if not name.startswith("__")]:
    del globals()[name]
exec(__code__)
# To take the libraries down one by one takes time that nobody needs.
import atexit, os, sys
atexit._run_exitfuncs()
sys.stdout.flush()
sys.stderr.flush()
os._exit(0)
"""


class Ended(NamedTuple):
    """A process that has ended."""

    returncode: int
    stdout: str
    stderr: str


class Forked:
    """Runs code; a context manager that ends the process from which it forks."""

    def __init__(self, libraries=LIBRARIES):
        paths = {"PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
        self._server = subprocess.Popen(
            [sys.executable, "-c", SERVER, *libraries],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | paths,
            text=True,
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._server.communicate()

    def run(self, code, folder):
        """The result of the code as the main program, `folder` being its working folder."""
        printed = {name: folder / f".{name}" for name in ("out", "err")}
        asked = json.dumps(
            {"code": code, "folder": str(folder)}
            | {name: str(path) for name, path in printed.items()}
        )
        self._server.stdin.write(f"{asked}\n")
        self._server.stdin.flush()
        status = int(self._server.stdout.readline())
        return Ended(status, *(path.read_text() for path in printed.values()))
