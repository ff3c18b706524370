"""Install the wheel with one extra after the other, each in an environment of its own, and do what
the extra is for: `make test-extras`, or `make test-extras EXTRAS="viewer video"`.
"""

import subprocess
import sys
import tempfile
import venv
from pathlib import Path

SHORT = "--scenario-parameters duration_s=0.5"
SCHEDULER = """
from distributed import LocalCluster
from care_sim.cli import main

if __name__ == "__main__":
    with LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster:
        main(["sweep", "--scenarios", "cutin", "--seeds", "1", "--cluster",
              cluster.scheduler_address])
"""
VECTOR = """
import gymnasium as gym
import care_sim
from care_sim.wrappers import VectorGridObservation, VectorSectorReserve
from torchrl.envs import GymWrapper

made = gym.make_vec("CARE-Dense-v0", num_envs=2, autoreset_mode="Disabled", duration_s=0.5)
print(GymWrapper(VectorGridObservation(VectorSectorReserve(made))).rollout(3).shape)
"""
BAG = """
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from care_sim.base.errors import InvalidInput
from care_sim.sources.installed import recordings

store = get_typestore(Stores.ROS2_HUMBLE)
with Writer("drive", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
    bag.add_connection("/points", "sensor_msgs/msg/PointCloud2", typestore=store)
try:
    recordings("sweeps:drive").film("drive")
except InvalidInput as error:
    assert "the bag has /points" in str(error), error
"""
ONNX = """
import base64
from pathlib import Path

# A network that takes points (P, 3) and finds nothing.
Path("none.onnx").write_bytes(base64.b64decode(
    "CAg6zAEKFgoBYxIHY2xhc3NlcyIISWRlbnRpdHkKFAoBYhIFYm94ZXMiCElkZW50aXR5ChUKAXMSBnNjb3JlcyIISWRl"
    "bnRpdHkSAWcqCQgAEAdCAWNKACoLCAAIBxABQgFiSgAqCQgAEAFCAXNKAFoZCgZwb2ludHMSDwoNCAESCQoDEgFQCgII"
    "A2IVCgdjbGFzc2VzEgoKCAgHEgQKAggAYhcKBWJveGVzEg4KDAgBEggKAggACgIIB2IUCgZzY29yZXMSCgoICAESBAoC"
    "CABCBAoAEA0="
))
"""
USES = {
    "open3d": [f"care-sim run dense --policy farthest-points {SHORT} --export scans"],
    "rl": [
        f"care-sim run dense --detector pillars {SHORT}",
        "care-sim train ppo --env CARE-CutIn-v0 --steps 1024 --episodes 1 --out ppo",
    ],
    "torchrl": ["python vector.py"],
    "viewer": [f"care-sim run dense {SHORT} --record a.rrd"],
    "video": [f"care-sim run dense {SHORT} --video a.mp4"],
    "cluster": ["python cluster.py"],
    "minari": [
        f"care-sim export minari dense {SHORT} --episodes 2 --dataset care-sim/tried-v0",
        "minari list local",
    ],
    "rosbags": ["python bag.py"],
    "onnx": [
        "python network.py",
        f"care-sim run dense --detector onnx --detector-parameters file=none.onnx {SHORT}",
    ],
}
"""Commands that use each extra; they write to an empty folder."""


def fails(extra: str, wheel: Path, constraints: Path) -> str:
    """The failure of an extra, in the words of the command; empty where all is well."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "cluster.py").write_text(SCHEDULER)
        (folder / "vector.py").write_text(VECTOR)
        (folder / "bag.py").write_text(BAG)
        (folder / "network.py").write_text(ONNX)
        venv.create(folder / "venv", with_pip=True)
        install = ["python", "-m", "pip", "install", "--quiet", "--constraint", f"{constraints}"]
        for command in ([*install, f"{wheel}[{extra}]"], *map(str.split, USES[extra])):
            program, *words = command
            done = subprocess.run(
                [folder / "venv" / "bin" / program, *words],
                cwd=folder,
                capture_output=True,
                text=True,
                check=False,
            )
            if done.returncode != 0:
                return f"{' '.join(command)}\n{done.stdout[-1000:]}{done.stderr[-2000:]}"
    return ""


def main(wheel: str, constraints: str, *extras: str) -> int:
    """A line for every extra; 1 where one fails."""
    if unknown := {*extras} - {*USES}:
        print(f"no extra {', '.join(sorted(unknown))}; those that are tried: {', '.join(USES)}")
        return 2
    failed = False
    for extra in extras or USES:
        problem = fails(extra, Path(wheel).resolve(), Path(constraints).resolve())
        print(f"{extra}: {problem or 'works alone'}", flush=True)
        failed |= bool(problem)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
