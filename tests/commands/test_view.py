"""`care-sim view`, and the commands that record."""

import re
import signal
import socket
import sys
import time
from urllib.error import URLError
from urllib.request import urlopen

import pytest

from care_sim.cli import main
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import run_episode
from tests.helpers.commands import run
from tests.helpers.descendants import Marked

SHORT = ["--scenario-parameters", "duration_s=0.5"]


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("recordings") / "deep" / "out.rrd"
    with pytest.raises(SystemExit):
        main(["run", "dartout", "--record", str(path), *SHORT])
    return path


@pytest.mark.parametrize(
    ("command", "option", "name"),
    [
        ("run", "--record", "out.rrd"),
        ("run", "--export", "scans"),
        ("compare", "--video", "out.gif"),
    ],
)
def test_what_stands_in_the_way_is_one_line_and_nothing_is_played(
    command, option, name, capsys, tmp_path, request
):
    if option == "--export":
        request.getfixturevalue("open3d")
    (tmp_path / name).mkdir()
    (tmp_path / name / "000.pcd").touch()
    code, out, err = run(capsys, command, "dartout", option, tmp_path / name, *SHORT)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert name in err


def test_without_a_display_the_browser_is_recommended(recording, capfd, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    code, _, err = run(capfd, "view", recording)
    assert code == 1
    assert err.splitlines()[-1].endswith("with --web a browser shows the recording")


@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_the_web_viewer_is_served_and_ends_with_its_children(recording, end):
    command = [sys.executable, "-m", "care_sim", "view", str(recording), "--web"]
    with Marked(command, stderr=None) as started:
        server = started.process
        url = re.search(r"http://(127\.0\.0\.1):(\d+)/\S*", server.stdout.readline())
        page = fetched(url.group())
        assert b"re_viewer" in page
        assert len(fetched(f"http://{url[1]}:{url[2]}/re_viewer_bg.wasm")) > 1e6
        server.send_signal(end)
        assert server.wait(timeout=20) == (-end if end == signal.SIGKILL else 0)
        assert started.all_end_within(30)
    with socket.socket() as client:
        assert client.connect_ex((url[1], int(url[2]))) != 0


def fetched(url):
    for play_batch in range(200):
        try:
            with urlopen(url, timeout=10) as page:
                return page.read()
        except URLError:
            if play_batch == 199:
                raise
            time.sleep(0.1)
    raise AssertionError


def test_compare_prints_and_records_the_same_seed_under_every_policy(capsys, tmp_path, read):
    file = tmp_path / "both.rrd"
    names = ("history", "all-camera", "care")
    options = ["--budget", "0.05", "--seed", "2", "--scenario-parameters", "duration_s=4"]
    code, out, _ = run(
        capsys, "compare", "dartout", "--policies", *names, *options, "--record", file
    )
    assert code == 0
    assert f"care-sim view {file}" in out
    found = read(file)
    for name in names:
        config = EpisodeConfig("dartout", name, 0.05, 2, scenario_parameters=(("duration_s", 4.0),))
        row = run_episode(config)
        (line,) = (line for line in out.splitlines() if line.split()[:1] == [name])
        assert line.split()[2] == f"{row['detection_distance_m']:.2f}"
        assert line.split()[-1] == str(row["rays_fired"])
        assert len(found.numbers(f"{name}/measures/speed")) == row["keyframes"] == 40
        states = found.rows[f"{name}/states/actor"]
        seen = min(n for n, change in states.items() if change["StateChange:state"] == ["detected"])
        assert found.numbers(f"{name}/measures/distance")[seen] == row["detection_distance_m"]
    sighted = {name: found.column(f"{name}/world/bodies", "Boxes3D:centers")[0] for name in names}
    assert sighted["history"] == sighted["care"] == sighted["all-camera"]
