"""Open3D where it can be imported, and packages as pip would leave them."""

import sys

import pytest

from care_sim.errors import MissingExtra
from care_sim.extras import import_open3d


@pytest.fixture(scope="session")
def open3d():
    try:
        return import_open3d()
    except MissingExtra as error:
        pytest.skip(str(error))


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Puts a distribution on the path, as pip would leave it: one module, and detectors by name."""

    def put(package, source, **detectors):
        place = tmp_path / package
        info = place / f"{package}-1.5.dist-info"
        info.mkdir(parents=True)
        (place / f"{package}.py").write_text(source)
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.5\n")
        lines = [f"{name} = {package}:{thing}" for name, thing in detectors.items()]
        (info / "entry_points.txt").write_text("\n".join(["[care_sim.detectors]", *lines]))
        monkeypatch.syspath_prepend(str(place))
        packages.append(package)

    packages = []
    yield put
    for package in packages:
        sys.modules.pop(package, None)
