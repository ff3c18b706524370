"""The certificate as a processor without AVX-512 plays it."""

import pytest

from care_sim.certify import published
from care_sim.certify.design import STREET, drawn
from care_sim.certify.verdict import verdict_of
from tests.certify.elsewhere import trails_elsewhere
from tests.helpers.processor_features import WIDE

NUMBERS = [n for n in range(150) if drawn(n).environment != STREET and drawn(n).keyframes <= 16][
    :60
]


@pytest.mark.slow
@pytest.mark.skipif(not WIDE, reason="every test plays as a processor without AVX-512 here")
def test_a_processor_without_avx512_plays_as_published(pytestconfig):
    """`test_certify.py` tests for 28 episodes that this processor plays them as published;
    `care-sim certify` plays every episode of the list.
    """
    narrow = published.read_narrow()
    other = min(narrow, key=lambda number: drawn(number).keyframes)
    code = pytestconfig.cache.mkdir("compiled-elsewhere")
    found = trails_elsewhere([*NUMBERS, other], 1, code)
    assert found[other] == narrow[other] != published.read()[other]
    verdict = verdict_of(found, published.read(), narrow)
    assert verdict.as_published, "\n".join(verdict.lines())
