import sys

import pytest

from care_sim.world.bare import bare


@pytest.fixture
def package(tmp_path, monkeypatch):
    """The name of a package whose own import takes note of itself."""
    folder = tmp_path / "costly_package"
    folder.mkdir()
    (folder / "__init__.py").write_text("WHOLE = True\nfrom costly_package import part\n")
    (folder / "part.py").write_text("from costly_package.other import NUMBER\n")
    (folder / "other.py").write_text("NUMBER = 7\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield "costly_package"
    for name in [name for name in sys.modules if name.startswith("costly_package")]:
        del sys.modules[name]


def test_a_part_comes_without_the_package_and_leaves_no_trace(package):
    with bare(package):
        from costly_package.part import NUMBER

        assert not hasattr(sys.modules[package], "WHOLE")
    assert NUMBER == 7
    assert not [name for name in sys.modules if name.startswith(package)]


def test_who_imports_the_package_later_gets_it_whole(package):
    with bare(package):
        import costly_package.part
    import costly_package

    assert costly_package.WHOLE
    assert costly_package.part.NUMBER == costly_package.other.NUMBER == 7


def test_a_package_that_is_imported_already_is_left_alone(package):
    import costly_package

    with bare(package):
        from costly_package import part
    assert sys.modules[package] is costly_package
    assert part is costly_package.part


def test_an_error_inside_leaves_no_trace_either(package):
    with pytest.raises(ZeroDivisionError), bare(package):
        raise ZeroDivisionError
    assert package not in sys.modules


def test_a_package_that_is_not_there_is_missed_by_its_import():
    with pytest.raises(ModuleNotFoundError, match="no_such_package"), bare("no_such_package"):
        import no_such_package.part  # noqa: F401
