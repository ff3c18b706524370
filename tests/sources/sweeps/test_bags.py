"""ROS 2 bags and MCAP files hold the same log as a folder."""

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.sources.installed import recordings
from tests.helpers.sweeps_log import write_log

pytest.importorskip("rosbags")

from tests.helpers.sweeps_bag import (
    ODOMETRY,
    POSE,
    SECONDS,
    write_bag,
)


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    folder = write_log(tmp_path_factory.mktemp("log") / "drive", seconds=SECONDS)
    return recordings(f"sweeps:{folder}").film("drive")


@pytest.mark.parametrize("kind", [ODOMETRY, POSE])
@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_a_bag_makes_the_film_that_its_folder_makes(tmp_path, film, kind, storage):
    write_bag(tmp_path / "drive", kind, storage)
    source = recordings(f"sweeps:{tmp_path / 'drive'}")
    (name,) = source.scenes()
    other = source.film(name)
    assert len(other.shots) == len(film.shots) == 4
    for one, two in zip(film.shots, other.shots, strict=True):
        assert two.time_s == pytest.approx(one.time_s, abs=1e-6)
        assert two.ego.speed == pytest.approx(one.ego.speed, abs=1e-4)
        assert two.annotations.boxes == pytest.approx(one.annotations.boxes, abs=1e-3)
    assert source.files(name)[0] == tmp_path / "drive"


def test_a_single_mcap_file_and_topics_by_name(tmp_path, film):
    bag = write_bag(tmp_path / "drive", more=["/front/points"])
    (file,) = bag.glob("*.mcap")
    source = recordings(f"sweeps:{file}", {"topics": ("/front/points", "/pose")})
    (name,) = source.scenes()
    assert len(source.film(name).shots) == len(film.shots)
    assert recordings(f"sweeps:{file}").scenes() == [name]


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (
            {"more": ["/front/points"]},
            r"several topics of sensor_msgs/msg/PointCloud2; name one with --topics; the bag has "
            r"/points \(sensor_msgs/msg/PointCloud2\), /front/points",
        ),
        ({"kind": ""}, "no topic of nav_msgs/msg/Odometry or geometry_msgs/msg/PoseStamped"),
    ],
)
def test_topics_that_are_missing_or_ambiguous_are_listed(tmp_path, given, told):
    source = recordings(f"sweeps:{write_bag(tmp_path / 'drive', **given)}")
    with pytest.raises(InvalidInput, match=told):
        source.film(source.scenes()[0])


@pytest.mark.parametrize("storage", ["MCAP", "SQLITE3"])
def test_a_damaged_bag_is_told_in_a_line(tmp_path, storage):
    bag = write_bag(tmp_path / "drive", storage=storage)
    (file,) = (path for path in bag.iterdir() if path.suffix in (".mcap", ".db3"))
    whole = file.read_bytes()
    source = recordings(f"sweeps:{bag}")
    for content in (b"", whole[: len(whole) // 2], b"\0" * 100, whole[:50] + whole[90:]):
        file.write_bytes(content)
        with pytest.raises(InvalidInput, match="no bag that can be read") as caught:
            source.film(source.scenes()[0])
        assert "\n" not in str(caught.value)


def test_camera_boxes_of_a_file_lie_beside_it(tmp_path):
    (file,) = write_bag(tmp_path / "drive").glob("*.mcap")
    source = recordings(f"sweeps:{file}")
    boxes = file.with_suffix(".camera_boxes.json")
    assert source.files(source.scenes()[0]) == [file, boxes]
    boxes.write_text("[1]")
    with pytest.raises(InvalidInput, match=r"camera_boxes\.json"):
        source.film(source.scenes()[0])
