"""Whether worlds discriminate: the verdicts, what they rest on, and every policy in every world."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import combinations

from care_sim.base.errors import counted, percent
from care_sim.evaluation.censoring import FEWEST_PAIRS, quartiles
from care_sim.reports.contrasts import GATE_COLLISION_POINTS, GATE_M
from care_sim.reports.controls import BEST_CONTROL
from care_sim.reports.formatting import interval, marked, mean, median, tag_notes
from care_sim.reports.table import Bold, Table
from care_sim.reports.validation import SEPARATED, Lead, WorldPlays, played_worlds
from care_sim.study.designs.validate import MEMORISER, is_training
from care_sim.study.rows.reading import detections, is_missed
from care_sim.study.run_config import FULL, Row

_Line = tuple[str, ...]
_BEST_CAMERA = "best camera policy"
_HINDSIGHT = "control in hindsight"
_CHOICE = (
    f"The {BEST_CONTROL} and the {_BEST_CAMERA} are those with the fewest collisions on the "
    "training seeds, of equal ones that with the earliest first detection; every other number is "
    "of test seeds. Controls are patterns that no camera moves, two of them learned on the "
    f"training seeds. The {_HINDSIGHT} is the best by the test seeds themselves: a choice that "
    "favours the control, beside the verdicts and no part of them."
)
_QUESTIONS = (
    f"A policy leads another where it detects {GATE_M} m earlier, or avoids "
    f"{GATE_COLLISION_POINTS:.0f} points more of the collisions that the full scan avoids on the "
    "same seed, the interval excludes zero, and nothing that counts as much speaks against it. "
    f"1: the {_BEST_CAMERA} leads the {BEST_CONTROL}, by this much. 2: the full scan leads the "
    f"{BEST_CONTROL}, so that there is something to win. 3: each two of {', '.join(SEPARATED)} are "
    "told apart by the same gates. A world discriminates at a budget where all three are so. Too "
    f"few: no difference counts on fewer than {FEWEST_PAIRS} test seeds."
)
_HIT = (
    "Hit: episodes with a collision. Lost: episodes in which the full scan itself hits, or never "
    "detects the first-sighting actor."
)


def validation_tables(rows: Sequence[Row]) -> list[Table]:
    """The verdicts and the collisions world by world, then for each world what they rest on and
    what every policy reaches.
    """
    worlds = played_worlds(rows)
    return [
        _by_world(
            "Does the world discriminate?",
            _VERDICT_COLUMNS,
            worlds,
            _verdict,
            (_CHOICE, _QUESTIONS),
        ),
        _by_world("Who is hit?", _HIT_COLUMNS, worlds, _hits, (_HIT,)),
        *(_lead_table(world) for world in worlds),
        *(_level_table(world) for world in worlds),
    ]


def validation_closing(rows: Sequence[Row]) -> list[str]:
    """Which seeds were played, and the verdict on every world."""
    parts = (
        ("test", {row["seed"] for row in rows if not is_training(row)}),
        ("training", {row["seed"] for row in rows if is_training(row)}),
    )
    told = " and ".join(
        f"{counted(len(seeds), f'{name} seed')} from {min(seeds)} to {max(seeds)}"
        for name, seeds in parts
        if seeds
    )
    worlds = played_worlds(rows)
    ran_into = [world.ran_into for world in worlds if world.ran_into]
    return [f"Played: {told}.", *(world.verdict for world in worlds), *ran_into]


_VERDICT_COLUMNS = (
    "budget",
    _BEST_CAMERA,
    BEST_CONTROL,
    _HINDSIGHT,
    "1: leads",
    "by, m",
    "by, points",
    "2: to win",
    "3: apart",
    "discriminates",
)
_HIT_COLUMNS = (
    "budget",
    "full: lost",
    "full: hit",
    _BEST_CAMERA,
    BEST_CONTROL,
    _HINDSIGHT,
    "all-camera",
    "care",
    "history",
    "random",
    MEMORISER,
)


def _by_world(
    title: str,
    columns: _Line,
    worlds: Sequence[WorldPlays],
    line: Callable[[WorldPlays, float], _Line],
    notes: tuple[str, ...],
) -> Table:
    """A line for each budget of each world, below the name of the world."""
    lines: list[_Line] = []
    for world in worlds:
        lines.append((world.setting.label,))
        lines += [line(world, budget) for budget in world.budgets]
    return Table(title, columns, tuple(lines), notes)


def _verdict(world: WorldPlays, budget: float) -> _Line:
    lead = world.camera_lead(budget)
    return (
        percent(budget),
        world.best_camera(budget) or "",
        world.best_control(budget) or "",
        world.hindsight_control(budget) or "",
        _answer(world, lead.leads),
        mean(lead.detection),
        mean(lead.avoided),
        _answer(world, world.full_lead(budget).leads),
        _answer(world, all(pair.is_told for pair in world.separations(budget).values())),
        _answer(world, not world.failings(budget)),
    )


def _answer(world: WorldPlays, so: bool) -> str:
    if world.has_too_few:
        return "too few"
    return Bold("yes") if so else "no"


def _hits(world: WorldPlays, budget: float) -> _Line:
    named = (
        FULL,
        world.best_camera(budget),
        world.best_control(budget),
        world.hindsight_control(budget),
        "all-camera",
        "care",
        "history",
        "random",
        MEMORISER,
    )
    full = world.played(FULL, budget)
    played = [world.played(policy, budget) if policy else [] for policy in named]
    return (
        percent(budget),
        _share([row["collision"] or is_missed(row) for row in full]),
        *(_share([row["collision"] for row in rows]) for rows in played),
    )


def _share(which: Sequence[bool]) -> str:
    return f"{sum(which)}/{len(which)}" if which else ""


def _lead_table(world: WorldPlays) -> Table:
    """What the answers rest on, and what the memoriser has, budget by budget."""

    def over_best_camera(policy: str, budget: float) -> Lead:
        return world.lead(policy, world.best_camera(budget), budget)

    leads: list[tuple[str, Callable[[float], Lead]]] = [
        (f"1: {_BEST_CAMERA} minus {BEST_CONTROL}", world.camera_lead),
        (f"1: {_BEST_CAMERA} minus {_HINDSIGHT}", world.hindsight_lead),
        (f"2: full minus {BEST_CONTROL}", world.full_lead),
        *(
            (f"3: {' minus '.join(pair)}", partial(world.lead, *pair))
            for pair in combinations(SEPARATED, 2)
        ),
        (f"{MEMORISER} minus {_BEST_CAMERA}", partial(over_best_camera, MEMORISER)),
        (f"full minus {_BEST_CAMERA}", partial(over_best_camera, FULL)),
    ]
    lines = tuple(line for name, lead_at in leads for line in _lead_lines(name, lead_at, world))
    title = f"{world.setting.label}: who leads whom"
    columns = ("", *map(percent, world.budgets))
    return Table(title, columns, lines, tag_notes(world.tags.values()))


def _lead_lines(name: str, lead_at: Callable[[float], Lead], world: WorldPlays) -> Iterator[_Line]:
    leads = [lead_at(budget) for budget in world.budgets]
    yield (f"{name}, m", *(interval(lead.detection) for lead in leads))
    yield (f"{name}, points", *(interval(lead.avoided) for lead in leads))


def _level_table(world: WorldPlays) -> Table:
    """Median first detection and collisions of every policy on the test seeds."""
    lines = [
        (marked(policy, tags), *(_level(world.played(policy, budget)) for budget in world.budgets))
        for policy, tags in world.tags.items()
    ]
    columns = ("policy", *(f"{percent(budget)}: first detection, hit" for budget in world.budgets))
    notes = ("First detection: median in metres. Hit: episodes with a collision.",)
    return Table(
        f"{world.setting.label}: every policy on the test seeds",
        columns,
        tuple(lines),
        (*notes, *tag_notes(world.tags.values())),
        terminal=False,
    )


def _level(rows: Sequence[Row]) -> str:
    found = median(quartiles(detections(rows)))
    return f"{found}, {_share([row['collision'] for row in rows])}" if rows else ""
