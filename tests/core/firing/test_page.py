"""The page of the hardware tells what the code says of it."""

from care_sim.core.firing.listing import HARDWARE, form_of
from tests.helpers.places import ROOT


def test_every_kind_stands_on_its_page_with_product_and_source():
    page = (ROOT / "docs" / "firing.md").read_text()
    for kind in HARDWARE.values():
        line = f"| `{form_of(kind)}` | {kind.unit} | {kind.product} | {kind.source} |"
        assert line in page.splitlines()
