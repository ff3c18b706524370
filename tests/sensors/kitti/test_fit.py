"""The shipped numbers are those that the data give."""

import json
from pathlib import Path

import numpy as np
import pytest

from care_sim.sensors.kitti import numbers
from tests.helpers.kitti_object import kitti_pictures, needs_kitti


@needs_kitti
def test_the_shipped_table_is_made_again_from_the_data():
    pytest.importorskip("sklearn")
    from tests.sensors.kitti.fit import as_text, fitted

    shipped = json.loads(Path(numbers.__file__).with_name("measured.json").read_text())
    again = json.loads(as_text(fitted(kitti_pictures())))
    assert shipped.keys() == again.keys()
    for name, own in shipped.items():
        flat, flat_again = (np.array(list(_numbers(_sorted(one)))) for one in (own, again[name]))
        # Optimisers end a little elsewhere on other machines.
        assert flat_again == pytest.approx(flat, rel=0.02, abs=0.02), name


def _sorted(value):
    """The same with the components of mixtures in the order of their means: fits may swap them."""
    if isinstance(value, dict) and "weights" in value:
        return sorted(zip(value["means"], value["weights"], value["covariances"], strict=True))
    if isinstance(value, dict):
        return {name: _sorted(one) for name, one in value.items()}
    return list(map(_sorted, value)) if isinstance(value, list) else value


def _numbers(value):
    if isinstance(value, dict):
        value = value.values()
    if isinstance(value, int | float):
        yield value
    elif not isinstance(value, str):
        for one in value:
            yield from _numbers(one)
