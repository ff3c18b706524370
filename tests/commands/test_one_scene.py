"""A scene of the open loop is played and watched as an episode of the closed one is."""

import re
from functools import partial

import pytest
from PIL import Image

from care_sim.base.errors import InvalidInput
from care_sim.commands.options.watching import WatchOptions
from care_sim.commands.shared.one_scene import scene_of
from care_sim.sources.named import source_of
from care_sim.sources.scenes import film_of
from care_sim.study.play_config import play_grid
from care_sim.study.scene_play import ScenePlayer
from tests.helpers.av2_log import at, box, write
from tests.helpers.commands import run
from tests.helpers.short_streets import few_and_short


@pytest.fixture
def played(capsys):
    return partial(run, capsys)


def test_a_log_is_told_by_its_first_sightings_and_is_the_play_of_the_protocol(played, drive):
    source = source_of(f"argoverse2:{drive}")
    (config,) = play_grid(source, source.scenes(), ["care"], [0.05])
    row = ScenePlayer(config).row(config)
    code, out, err = played("run", f"argoverse2:{drive}", "--budget", "0.05")
    assert (code, err) == (0, "")
    assert max(map(len, out.splitlines())) <= 80
    told = dict(re.findall(r"^(\S.*?)  +(\S+)$", out, re.MULTILINE))
    assert told["episode_hash"] == row["episode_hash"]
    assert told["first sightings"] == f"{row['events']:.0f}" == "1"
    assert float(told["found %"]) == pytest.approx(100 * row["found"] / row["frames"], abs=0.05)
    (sighting,) = re.findall(r"^ +([\d.]+) s  (\S+) \d+, ([\d.]+) m: (.*)$", out, re.MULTILINE)
    assert sighting[1:] == ("pedestrian", sighting[2], "found at once")
    # The line of the table at which it appears: one new object, found at once.
    assert re.search(rf"^ *{sighting[0]} .* 1 +1 +819 *$", out, re.MULTILINE)


def test_the_seed_is_that_of_the_street_and_a_scene_has_a_name(played):
    with few_and_short(4):
        for options, name in (
            (["--seed", "2"], "street-0002"),
            (["--scene", "street-0001-bend"], "street-0001-bend"),
            (["--seed", "1003", "--split", "calibration"], "street-1003"),
        ):
            code, out, err = played("run", "street", "--policy", "random", *options)
            assert (code, err) == (0, "")
            assert out.startswith(name)


def test_a_source_of_a_single_street_has_no_other_seed(tmp_path, monkeypatch):
    (tmp_path / "onestreet.py").write_text(
        "from dataclasses import dataclass\n"
        "from care_sim.sources.scenes import Generated\n"
        "from care_sim.streets.street import make_street\n"
        "@dataclass(frozen=True)\nclass One(Generated):\n"
        "    def seeds(self):\n        return [7]\n"
        "    def street(self, seed):\n        return make_street(seed)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    source = source_of("onestreet:One")
    assert scene_of(WatchOptions(seed=7), source).seed == 7
    with pytest.raises(InvalidInput, match=r"seed must be of a scene of onestreet:One.* got 3"):
        scene_of(WatchOptions(seed=3), source)
    assert scene_of(WatchOptions(scene="one-0007", seed=7), source).seed == 7


def test_policies_are_compared_on_one_film_and_filmed_side_by_side(played, drive, tmp_path):
    film = tmp_path / "film.png"
    source = source_of(f"argoverse2:{drive}")
    names = ("history", "care", "full")
    code, out, _ = played(
        "compare", f"argoverse2:{drive}", "--policies", *names, "--budget", "0.05", "--video", film
    )
    assert code == 0
    lines = {line.split()[0]: line.split()[1:] for line in out.splitlines() if line}
    assert [lines[name][:3] for name in names] == [
        ["0.05", "1", "0.0"],
        ["0.05", "1", "100.0"],
        ["1", "1", "100.0"],
    ]
    with Image.open(film) as pictures:
        assert pictures.size == (3 * 512 + 2 * 8, 730)
        # As long as the film: one picture a keyframe.
        assert pictures.n_frames == len(film_of(source, source.scenes()[0]).shots)


def test_the_picture_is_of_the_first_keyframe_at_which_somebody_appears_or_of_a_time(
    played, drive, tmp_path
):
    line = ("run", f"argoverse2:{drive}", "--budget", "0.05", "--picture")
    pictures = {}
    for name, options in (("first", ()), ("then", ("--at", 2.5)), ("before", ("--at", 2.1))):
        file = tmp_path / "deep" / f"{name}.png"
        code, _, err = played(*line, file, *options)
        assert (code, err) == (0, "")
        with Image.open(file) as picture:
            assert picture.size == (960, 720)
            pictures[name] = picture.tobytes()
    # The person steps out at 2.5 s; what follows 2.1 s is that keyframe, too.
    assert pictures["first"] == pictures["then"] == pictures["before"]
    assert played(*line, tmp_path / "start.png", "--at", 0)[0] == 0
    with Image.open(tmp_path / "start.png") as picture:
        assert picture.tobytes() != pictures["first"]


def test_of_a_moment_that_never_comes_there_is_no_picture_and_the_play_is_told(played, tmp_path):
    # A car stands before one that stands.
    standing = box("REGULAR_VEHICLE", (12.0, 0.0, 0.42), track="standing")
    log = write(tmp_path / "log", [[standing]] * 11, [at(0.0)] * 11)
    picture = tmp_path / "x.png"
    line = ("run", f"argoverse2:{log}", "--policy", "full", "--picture", picture)
    for options, told in (((), "nobody appeared"), (("--at", 2), "no keyframe at 2 s or later")):
        code, out, err = played(*line, *options)
        assert (code, err.splitlines()[-1]) == (0, f"{told}: no picture")
        assert re.search("^found % +100.0$", out, re.M)
    assert not picture.exists()


def test_one_that_fails_leaves_the_others(played, drive, install, tmp_path):
    install(
        "falling",
        "import care_sim\nclass Falls(care_sim.Policy):\n"
        "    def demand(self, belief):\n        return 1 / 0\n",
        falls="Falls",
    )
    code, out, err = played("compare", f"argoverse2:{drive}", "--policies", "falls", "random")
    assert code == 1
    assert "random" in out
    assert "ZeroDivisionError: division by zero (falling.py, line 4)" in err
