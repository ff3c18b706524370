"""Shared scenes: small tables of tracks and detections, and a simulator that is freed after the
test.
"""

import os
import shutil
import signal
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from care_sim.base.errors import MissingExtra
from care_sim.base.extras import import_open3d
from care_sim.core.grid import AngularGrid
from care_sim.core.types import CLASSES, Detections, ImageDetections, Tracks
from care_sim.sensors.annotated import Annotations
from care_sim.world.bullet import BulletWorld
from tests.helpers.av2_log import at, box, write
from tests.helpers.misbehaving import ENTRY_POINTS, THIRD_PARTY
from tests.helpers.places import PUBLISHED, ROOT
from tests.helpers.short_streets import few_and_short

SLOW = {*(Path(__file__).with_name("slow.txt").read_text().split())}
"""Tests that took a second and a half of two cores, which `make test-long` runs: from
`--durations=0`."""


@pytest.fixture
def interruptible():
    """Also where the tests run in the background, with interrupts ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def pytest_collection_modifyitems(items):
    for item in items:
        if item.nodeid.partition("[")[0] in SLOW:
            item.add_marker(pytest.mark.slow)


# An unpacked sdist holds no published results, nor what else only a clone has: what is tested there
# is the installed package (`make test-installed`).
collect_ignore = [] if PUBLISHED.is_dir() else ["golden", "publish", "repository"]

settings.register_profile(
    "repeatable", deadline=None, derandomize=True, database=None, max_examples=60
)
settings.load_profile("repeatable")

# PyTorch is imported later and reads this then. Its threads wait for each other in busy loops: two
# of them beside another worker's tests take three to six times the processor time of one.
os.environ.setdefault("OMP_NUM_THREADS", "1")


@pytest.fixture(scope="session")
def grid():
    return AngularGrid()


@pytest.fixture(scope="session")
def recorded():
    """The folder with recorded data of development; the test is skipped where it is absent."""
    for folder in (ROOT / "shared" / "data", ROOT.parent / "shared" / "data"):
        if folder.is_dir():
            return folder
    pytest.skip("no recorded data in shared/data")


@pytest.fixture(scope="module")
def chromium():
    """A browser without a screen, driven by Playwright."""
    path = shutil.which("chromium")
    if path is None:
        pytest.skip("the browser tests need Chromium: apt-get install chromium")
    sync_api = pytest.importorskip(
        "playwright.sync_api", reason="the browser tests need the PyPI package playwright"
    )
    switches = ["--no-sandbox", "--disable-gpu", "--disable-background-networking"]
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=switches)
        yield browser
        browser.close()


@pytest.fixture
def bullet():
    world = BulletWorld()
    yield world
    world.close()


@pytest.fixture(scope="session")
def tracks_at():
    """Makes tracks from (class name, x, y, vx, vy); ids count from `first_id`."""

    def make(*objects, z=-1.0, size=(2.0, 1.0, 2.0), first_id=0, hits=2):
        rows = [
            [first_id + n, CLASSES.index(name), x, y, z, *size, 0.0, vx, vy, 0, hits]
            for n, (name, x, y, vx, vy) in enumerate(objects)
        ]
        return Tracks.from_rows(np.array(rows, dtype=float).reshape(-1, len(Tracks.COLUMNS)))

    return make


@pytest.fixture(scope="session")
def seen():
    """Makes camera detections from (class name, left, top, right, bottom)."""

    def make(*objects, camera=0, yaw_change=0.0):
        rows = [[CLASSES.index(name), 0.9, *box, camera, 0.0, yaw_change] for name, *box in objects]
        return ImageDetections.from_rows(
            np.array(rows, dtype=float).reshape(-1, len(ImageDetections.COLUMNS))
        )

    return make


@pytest.fixture(scope="session")
def drive(tmp_path_factory):
    """An Argoverse 2 log of 10 keyframes: 5 m/s past a van and two cars; halfway a person steps out
    of a house.
    """

    def seen(sweep):
        ahead = 30.0 - 0.5 * sweep
        standing = [
            box("BOX_TRUCK", (ahead, -4.0, 0.9), (6.0, 2.2, 2.6), track="van"),
            box("REGULAR_VEHICLE", (ahead + 9.0, -4.0, 0.42), track="parked"),
            box("REGULAR_VEHICLE", (ahead - 15.0, 3.5, 0.42), yaw=3.1, track="oncoming"),
        ]
        person = box(
            "PEDESTRIAN", (ahead + 6.0, 7.0 - 0.1 * (sweep - 25), 0.6), (0.6, 0.7, 1.8), yaw=-1.57
        )
        return [*standing, person] if sweep >= 25 else standing

    folder = tmp_path_factory.mktemp("logs") / "drive"
    return write(folder, [seen(n) for n in range(50)], [at(0.5 * n) for n in range(50)])


@pytest.fixture(scope="module")
def short_streets():
    """Environments of the open loop meet four streets of 10 keyframes."""
    with few_and_short():
        yield


@pytest.fixture(scope="session")
def published():
    """The folder of the published results; skips what reads them where there is no clone."""
    if not PUBLISHED.is_dir():
        pytest.skip("published results are in a clone alone")
    return PUBLISHED


@pytest.fixture(scope="session")
def open3d():
    """Open3D; skips what needs it where it cannot be imported."""
    try:
        return import_open3d()
    except MissingExtra as error:
        pytest.skip(str(error))


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Puts a distribution on the path, as pip would leave it: one module, and policies or detectors
    by name.
    """

    def put(package, source, group="care_sim.policies", **things):
        place = tmp_path / package
        info = place / f"{package}-1.5.dist-info"
        info.mkdir(parents=True)
        (place / f"{package}.py").write_text(source)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.5\n")
        lines = [f"{name} = {package}:{thing}" for name, thing in things.items()]
        (info / "entry_points.txt").write_text("\n".join([f"[{group}]", *lines]))
        monkeypatch.syspath_prepend(str(place))
        packages.append(package)

    packages = []
    yield put
    for package in packages:
        sys.modules.pop(package, None)


@pytest.fixture
def third_party(tmp_path, monkeypatch):
    """An installed package whose policies do not behave."""
    site = tmp_path / "site"
    info = site / "misbehaving-1.0.dist-info"
    info.mkdir(parents=True)
    (site / "misbehaving.py").write_text(THIRD_PARTY)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: misbehaving\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(ENTRY_POINTS)
    monkeypatch.syspath_prepend(site)
    return site


class Read:
    """The content of a recording: `fixed` entities, and the rows of the others by keyframe."""

    def __init__(self, path):
        from rerun.chunk import RrdReader

        self.fixed, self.rows, self.seconds = {}, defaultdict(dict), {}
        for chunk in RrdReader(path).stream().to_chunks():
            name = chunk.entity_path.lstrip("/")
            for row in chunk.to_record_batch().to_pylist():
                if chunk.is_static:
                    self.fixed.setdefault(name, {}).update(row)
                else:
                    self.rows[name][row["keyframe"]] = row
                    self.seconds[row["keyframe"]] = row["seconds"].total_seconds()

    def column(self, entity, component):
        """The value of a component at every keyframe, in order: the latest that was logged."""
        values, latest = [], None
        for keyframe in sorted(self.seconds) if entity in self.rows else ():
            latest = self.rows[entity].get(keyframe, {component: latest})[component]
            values.append(latest)
        return values

    def numbers(self, entity):
        """The scalars of an entity."""
        return [value for (value,) in self.column(entity, "Scalars:scalars")]


@pytest.fixture(scope="session")
def read():
    """Reads a recording back; skips what needs it where Rerun is not installed."""
    pytest.importorskip("rerun")
    return Read


def _columns(classes, centres):
    boxes = np.array([[x, y, -1.0, 2.0, 1.0, 1.5, 0.0] for x, y in centres]).reshape(-1, 7)
    return np.array([CLASSES.index(name) for name in classes], np.int64), boxes


@pytest.fixture(scope="session")
def shown():
    """Annotations of a keyframe from (object, class name, x, y)."""

    def make(*objects):
        numbers = np.array([number for number, *_ in objects], np.int64)
        return Annotations(numbers, *_columns([o[1] for o in objects], [o[2:] for o in objects]))

    return make


@pytest.fixture(scope="session")
def reported():
    """Detections from (class name, x, y), or with a score each (class name, x, y, score)."""

    def make(*objects):
        scores = np.array([o[3] for o in objects]) if objects and len(objects[0]) > 3 else None
        found = _columns([o[0] for o in objects], [o[1:3] for o in objects])
        return Detections(*found, np.full(len(objects), 3), scores)

    return make
