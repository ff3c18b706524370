"""Every writer where a name is not UTF-8, and where a file cannot grow: an error that names the
file, what was there stays, nothing torn is left.

A limit on the size of files stands for the full disk: it needs no rights.
"""

import os
import resource
from contextlib import contextmanager

import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

from care_sim.base.errors import MissingExtra
from care_sim.core.grid import AngularGrid
from care_sim.policies.learned import weights
from care_sim.reports.figures.styles import save
from care_sim.study.rows.parquet import read_rows, write_rows
from care_sim.viewer.pictures.clip_files import write_clip

RNG = np.random.default_rng(0)
PICTURES = [Image.fromarray(RNG.integers(0, 255, (240, 320, 3), dtype=np.uint8)) for _ in range(3)]


def clip(path):
    write_clip(path, PICTURES, 0.1, 0.2)


def mp4(path):
    pytest.importorskip("imageio_ffmpeg")
    clip(path)


def recording(path):
    pytest.importorskip("rerun")
    from care_sim.viewer.recording.recording import Recording

    Recording(path, ["care"]).close()


def scans(path):
    import gymnasium

    from care_sim.wrappers import ExportScans

    with ExportScans(
        gymnasium.make("care_sim:CARE-Dartout-v0", duration_s=0.2, budget=1.0), path.parent
    ) as env:
        env.reset(seed=0)
        env.step(np.ones(env.action_space.shape, np.float32))


def arrays(path):
    weights.save_weights(path, {"layer": RNG.random(10_000)}, weights.Card("ppo", AngularGrid()))


def rows(path):
    write_rows([{"digest": str(n), "value": n / 7} for n in RNG.random(5_000)], path)


def figure(path):
    drawn = Figure()
    drawn.subplots().imshow(RNG.random((99, 99)))
    save(drawn, path)


@contextmanager
def no_file_larger_than(size):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


every_writer = pytest.mark.parametrize(
    ("write", "name"),
    [
        (mp4, "a.mp4"),
        (clip, "a.gif"),
        (clip, "a.webp"),
        (clip, "a.png"),
        (recording, "a.rrd"),
        (scans, "000.pcd"),
        (arrays, "a.npz"),
        (rows, "a.parquet"),
        (figure, "a.png"),
    ],
)


@every_writer
def test_a_name_that_is_not_utf_8_is_written(write, name, tmp_path):
    folder = tmp_path / os.fsdecode(b"z\xfc")
    file = folder / (name if write is scans else os.fsdecode(b"\xfc") + name)
    try:
        write(file)
    except MissingExtra as missing:
        pytest.skip(str(missing))
    assert file.stat().st_size > 5_000
    if write is rows:
        assert len(read_rows(file)) == 5_000


@every_writer
def test_a_file_that_does_not_fit_is_named_and_nothing_of_it_is_left(write, name, tmp_path):
    try:
        write(tmp_path / "whole" / name)
    except MissingExtra as missing:
        pytest.skip(str(missing))
    assert (tmp_path / "whole" / name).stat().st_size > 5_000
    file = tmp_path / "out" / name
    with no_file_larger_than(5_000), pytest.raises(OSError, match=r".") as error:
        write(file)
    assert error.value.filename == str(file)
    assert "File too large" in error.value.strerror
    assert [path.name for path in file.parent.iterdir() if path.name != "episode.json"] == []
