"""The page of the hardware lists every kind as the code describes it."""

from care_sim.core.firing.listing import HARDWARE, form_of
from tests.helpers.places import ROOT


def test_every_kind_has_its_row_with_unit_and_product():
    page = (ROOT / "docs" / "firing.md").read_text().splitlines()
    for kind in HARDWARE.values():
        assert f"| `{form_of(kind)}` | {kind.unit} | {kind.product} |" in page


def test_every_kind_has_a_source():
    assert all(kind.source for kind in HARDWARE.values())
