"""The list of policies, with what installed packages add, hide and break."""

from care_sim.policies import BUILT_IN, maker
from care_sim.policies.listing import parameter_texts, policy_paragraphs

GOOD = '''
import care_sim


class Good(care_sim.Policy):
    """Looks ahead.

    And more."""

    tags = ("causal", "learned")
    source = "Doe et al., 2026"

    def __init__(self, rig, reach, width=3, *, name="fan"):
        super().__init__(rig)

    def demand(self, belief):
        return care_sim.Demand()
'''


def test_every_built_in_policy_has_tags_a_source_and_a_summary_that_fit_80_columns():
    paragraphs = list(policy_paragraphs())
    assert [text.partition(" ")[0] for text in paragraphs] == list(BUILT_IN)
    for text, make in zip(paragraphs, map(maker, BUILT_IN), strict=True):
        title, *lines = text.splitlines()
        assert title == f"{make.name} ({', '.join(make.tags)})"
        assert make.source in " ".join(line.strip() for line in lines)
        assert 2 <= len(lines) <= 6
        # Told to its end.
        assert any(line.endswith(".") for line in lines)
        assert max(map(len, lines)) <= 80


def test_parameters_come_with_their_defaults():
    assert parameter_texts(BUILT_IN["history"]) == []
    assert parameter_texts(BUILT_IN["care"]) == ["yaw_compensation=True"]
    assert parameter_texts(BUILT_IN["random-points"]) == ["seed=0"]
    assert {"k_safe=2.0", "standstill_m=2.0"} <= set(parameter_texts(BUILT_IN["care-sbf"]))


def test_an_installed_policy_is_listed_with_its_package(install):
    install("good", GOOD, beacon="Good")
    assert list(policy_paragraphs())[-1].splitlines() == [
        "beacon (causal, learned)",
        "    Looks ahead. [good 1.5]",
        "    reach width=3 name='fan'",
        "    Doe et al., 2026",
    ]


def test_a_hidden_policy_is_said_to_be(install):
    install("good", GOOD, beacon="Good", care="Good")
    install("first", GOOD, beacon="Good")
    assert [text.splitlines() for text in policy_paragraphs()][len(BUILT_IN) :] == [
        [
            "beacon (causal, learned)",
            "    Looks ahead. [first 1.5]",
            "    reach width=3 name='fan'",
            "    Doe et al., 2026",
        ],
        ["beacon (hidden)", "    Not used: that of first 1.5 has its name. [good 1.5]"],
        ["care (hidden)", "    Not used: the built-in one has its name. [good 1.5]"],
    ]


def test_a_broken_policy_is_listed_with_the_reason(install):
    install("broken", "raise RuntimeError('no\\nweights')", torn="Torn")
    assert list(policy_paragraphs())[-1].splitlines() == [
        "torn (broken)",
        "    RuntimeError: no weights (broken.py, line 1) [broken 1.5]",
    ]
