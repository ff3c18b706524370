"""Compiled code where it can be kept, and where it cannot."""

import os
import subprocess
import sys
from textwrap import dedent

import pytest

from tests.helpers.forked import Forked
from tests.helpers.places import ROOT

_BRIEF = ("-k", "not crowds and not window0 and not whole_grids and not more_cells")
"""Leaves out what takes more than a few seconds in Python."""
NOWHERE = """
import numba.core.caching as caching
caching.CacheImpl._locator_classes = []
from care_sim.core.pinhole import window_around
import numpy as np
print(window_around(np.array([[2.5, 3.5, 4.5, 5.5]]), 9, 9))
"""


def test_without_a_folder_for_the_code_it_is_compiled_anew():
    done = subprocess.run(
        [sys.executable, "-c", NOWHERE], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "(1, 2, 6, 7)"


@pytest.mark.slow
def test_kernels_answer_the_same_without_compiling():
    files = (
        "core/firing/test_floor",
        "core/test_cell_sets",
        "perception/test_tracker",
        "loops/stages/test_motion",
    )
    places = [
        *(str(ROOT / "tests" / f"{file}.py") for file in files),
        f"{ROOT}/tests/sensors/engines/test_fast.py::test_a_body_at_a_known_distance",
        f"{ROOT}/tests/sensors/engines/test_picture_kernels.py",
        f"{ROOT}/tests/core/test_cell_order.py::test_agrees_with_the_orders_by_the_letter",
    ]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *places, *_BRIEF],
        cwd=ROOT,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout[-3000:]
    assert " passed" in done.stdout


# Python tells its bytecode by the second and the size of the source. These tests write a file twice
# within a second, so nothing is kept of it.
KEPT_HERE = """
import numba, os, sys
sys.dont_write_bytecode = True
numba.config.CACHE_DIR = os.path.join(os.getcwd(), "kept")
sys.path.insert(0, os.getcwd())
"""
TWO_FILES = """
from outer_kernels import outer
print(outer(1), sum(outer.stats.cache_hits.values()))
"""
OUTER = """
    from care_sim.base.compiled import compiled
    from inner_kernels import inner

    @compiled()
    def outer(number):
        return inner(number)
"""
INNER = """
    from care_sim.base.compiled import compiled

    @compiled()
    def inner(number):
        return number + {added}
"""


@pytest.fixture(scope="module")
def forked():
    with Forked() as forked:
        yield forked


@pytest.fixture
def outer(tmp_path, forked):
    """The answer of the kernel `outer` for 1 in a new process, and how often its kept code was
    used. The kernel calls one of another file that adds a number.
    """
    (tmp_path / "outer_kernels.py").write_text(dedent(OUTER))

    def run(added):
        (tmp_path / "inner_kernels.py").write_text(dedent(INNER).format(added=added))
        done = forked.run(KEPT_HERE + TWO_FILES, tmp_path)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    return run


def test_kept_code_is_used_while_no_file_of_kernels_changes(outer):
    assert [outer(added=1), outer(added=1)] == ["2 0", "2 1"]


def test_a_change_in_a_file_whose_kernel_is_called_is_noticed(outer):
    assert [outer(added=1), outer(added=5)] == ["2 0", "6 0"]


KERNEL = """
    from care_sim.base.compiled import compiled
    from data import SHIFT, {name}

    @compiled()
    def shifted(point):
        return point.x + SHIFT
"""
DATA = """
    from typing import NamedTuple

    SHIFT = {shift}

    class {name}(NamedTuple):
        x: int
        y: int
"""
SHIFTED = """
import data
from kernel import shifted
print(shifted(data.{name}(1, 2)), sum(shifted.stats.cache_hits.values()))
"""


@pytest.fixture
def shifted(tmp_path, forked):
    """The answer of a kernel that adds an imported constant to a field of an imported named tuple,
    and how often its kept code was used.
    """

    def run(name, shift):
        (tmp_path / "kernel.py").write_text(dedent(KERNEL).format(name=name))
        (tmp_path / "data.py").write_text(dedent(DATA).format(name=name, shift=shift))
        done = forked.run(KEPT_HERE + SHIFTED.format(name=name), tmp_path)
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    return run


def test_a_constant_of_another_file_is_noticed(shifted):
    assert [shifted("Point", 1), shifted("Point", 1), shifted("Point", 5)] == ["2 0", "2 1", "6 0"]


def test_kept_code_of_a_class_that_is_gone_is_not_read(shifted):
    assert [shifted("Point", 1), shifted("Place", 1)] == ["2 0", "2 0"]


COUNT = """
from numba.core.event import install_recorder
with install_recorder("numba:compile") as compiled:
    import care_sim
    alone = len(compiled.buffer)
    from care_sim.core.pinhole import window_around
    import numpy
    window_around(numpy.zeros((1, 4)), 9, 9)
print(alone, len(compiled.buffer) > 0)
"""


def test_the_package_alone_compiles_nothing(tmp_path):
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-c", COUNT]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "0 True"
