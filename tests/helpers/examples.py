"""The files of `docs/examples` as modules."""

from importlib.util import module_from_spec, spec_from_file_location

from tests.helpers.places import ROOT

EXAMPLES = ROOT / "docs" / "examples"


def loaded(file):
    """The module of a file that is in no package."""
    place = spec_from_file_location(file.stem, file)
    module = module_from_spec(place)
    place.loader.exec_module(module)
    return module
