"""ROS 2 bags and MCAP files hold the same log as a folder."""

from dataclasses import replace

import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.sources.installed import recordings
from care_sim.sources.sweeps.recordings import points_of_cloud
from tests.helpers.sweeps_log import START_NS, write_log

pytest.importorskip("rosbags")

from tests.helpers.sweeps_bag import (
    ODOMETRY,
    POSE,
    SECONDS,
    cloud,
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


def test_a_topic_that_the_bag_lacks_is_refused(tmp_path):
    bag = write_bag(tmp_path / "drive")
    for topic in ("/nothing", "/note"):
        source = recordings(f"sweeps:{bag}", {"topics": (topic,)})
        with pytest.raises(InvalidInput, match=f"{topic} is no topic of points or poses; the bag"):
            source.film(source.scenes()[0])


def test_topics_are_a_column_so_that_others_play_again(tmp_path):
    bag = write_bag(tmp_path / "drive", more=["/front/points"])
    assert recordings(f"sweeps:{bag}", {"topics": ("/points", "/pose")}).columns() == {
        "topics": "/points /pose"
    }


def test_rows_of_an_organised_cloud_may_be_padded():
    points = np.arange(12, dtype="<f4").reshape(2, 2, 3)
    padded = np.concatenate([points.view(np.uint8).reshape(2, 24), np.full((2, 5), 7, np.uint8)], 1)
    made = cloud(START_NS)
    fields = [replace(field, offset=field.offset - 4) for field in made.fields]
    shape = {"height": 2, "width": 2, "point_step": 12, "row_step": 29}
    told = replace(made, fields=fields, data=padded.ravel(), **shape)
    assert np.array_equal(points_of_cloud(told), points.reshape(4, 3))


def test_camera_boxes_of_a_file_lie_beside_it(tmp_path):
    (file,) = write_bag(tmp_path / "drive").glob("*.mcap")
    source = recordings(f"sweeps:{file}")
    boxes = file.with_suffix(".camera_boxes.json")
    assert source.files(source.scenes()[0]) == [file, boxes]
    boxes.write_text("[1]")
    with pytest.raises(InvalidInput, match=r"camera_boxes\.json"):
        source.film(source.scenes()[0])
