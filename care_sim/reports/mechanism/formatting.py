"""What the tables of the mechanism have in common."""

from care_sim.base.errors import percent
from care_sim.reports.formatting import marked, tag_notes
from care_sim.reports.mechanism.rows import MechanismRows
from care_sim.reports.protocol.notes import papers


def heading_of(study: MechanismRows, what: str) -> str:
    """The title of a table: setting, budget and what it shows."""
    return f"{study.setting.label}, {percent(study.budget)}: {what}"


def name_of(study: MechanismRows, policy: str) -> str:
    """A policy, with a mark where no car can have it."""
    return marked(policy, study.tags[policy])


def figure_of_paper(study: MechanismRows, figure: str) -> str:
    """A figure of the paper, where it is of the same."""
    return figure if study.as_in_paper else ""


def quotes_of_paper(study: MechanismRows, *sentences: str) -> tuple[str, ...]:
    """Its sentences, where they are of the same."""
    return papers(sentences) if study.as_in_paper else ()


def marks_of(study: MechanismRows) -> tuple[str, ...]:
    """What the marks of its policies mean."""
    return tag_notes(study.tags.values())
