"""The leaderboard: results of the benchmark in a table, and the page that explains it."""

from collections import Counter
from collections.abc import Sequence

from care_sim.base.errors import counted
from care_sim.evaluation.bootstrap import Interval
from care_sim.reports.formatting import MARKS, bounds, marked, tag_notes
from care_sim.reports.table import Bold, Table, TableRow
from care_sim.study.benchmark.made_by import code_of, processor_of
from care_sim.study.benchmark.result import BenchmarkResult
from care_sim.study.benchmark.tasks import CAMERAS, IDEAL, Entry
from care_sim.study.benchmark.worlds import BENCHMARK_VERSION

CONTROL = Entry("place")
"""A map of the places where things first appeared on 20 other streets; it has no camera and no
tracks. Of the controls it was the best on the training seeds of the drives and on the published
streets, before there was a benchmark."""
_AS_TOLD = "As the files say{}; care-sim leaderboard --verify plays a tenth of a file again."
_TRIAL = "A trial with the tenth of the worlds that --quick plays: no leaderboard."
_IN_HINDSIGHT = "Points, paired by world. The first is chosen by these results, which favours it."


def leaderboard_table(results: Sequence[BenchmarkResult], minus: str = CONTROL.name) -> Table:
    """A line for every result, the highest score first, with its lead over the entry `minus`, if
    that is among them. All must be of the same worlds.
    """
    named, control = _named(results, minus)
    # What no car can have stands where its score puts it, and takes no place.
    contenders = [each for _, each in named if not is_beyond(each)]
    numbers = {id(each): f"{number}" for number, each in enumerate(contenders, 1)}
    rows = tuple(_line(each, name, numbers.get(id(each), ""), control) for name, each in named)
    leads = () if control is None else (f"minus {minus}",)
    # The leads are the widest: at 80 characters all but they stand side by side.
    columns = ("", "policy", "score", *results[0].parts, "ideal camera", *leads)
    return Table(title(results), columns, rows, _notes(results), whole=("", "score"), names=2)


def leads_table(results: Sequence[BenchmarkResult], minus: str) -> Table | None:
    """The leads over the entry `minus` part by part, and with the ideal camera, of every other
    entry, in the order of their scores; None without that entry, or without another.
    """
    named, control = _named(results, minus)
    if control is None or len(named) == 1:
        return None
    rows = tuple(
        (
            name,
            *(_shown(each.lead(control, part=part)) for part in control.parts),
            _shown(each.lead(control, IDEAL)),
        )
        for name, each in named
        if each is not control
    )
    columns = ("policy", *control.parts, "score, ideal camera")
    title_of_leads = f"{title(results)}: minus {minus}, part by part"
    return Table(title_of_leads, columns, rows, (_TRIAL if control.quick else _IN_HINDSIGHT,))


def _named(
    results: Sequence[BenchmarkResult], minus: str
) -> tuple[list[tuple[str, BenchmarkResult]], BenchmarkResult | None]:
    """Names and results, the highest score first, and the one named `minus` if it is there."""
    in_order = ranked(results)
    named = [*zip(names_in(in_order), in_order, strict=True)]
    return named, next((each for name, each in named if name == minus), None)


def ranked(results: Sequence[BenchmarkResult]) -> list[BenchmarkResult]:
    """The highest score first; of equal ones that which was given first."""
    return sorted(results, key=lambda result: -result.score().mean)


def names_in(results: Sequence[BenchmarkResult]) -> list[str]:
    """The name of each, marked where no car can have it; with the start of the hash of its code
    where several have the name.
    """
    times = Counter(each.entry.name for each in results)
    return [
        marked(
            each.entry.name
            + (
                f" #{each.made_by.get('policy_code', '')}"[:9] if times[each.entry.name] > 1 else ""
            ),
            each.tags,
        )
        for each in results
    ]


def title(results: Sequence[BenchmarkResult]) -> str:
    """Version, and which worlds."""
    sealed = results[0].sealed
    worlds = len(results[0].rows) // len(CAMERAS)
    of = f"sealed by {sealed[:12]}" if sealed else "published"
    return f"CARE-Sim benchmark {BENCHMARK_VERSION}: {counted(worlds, 'world')}, {of}"


def _notes(results: Sequence[BenchmarkResult]) -> tuple[str, ...]:
    """Who vouches for the numbers, and what the marks mean."""
    codes = {*filter(None, map(code_of, results))}
    processors = {*filter(None, map(processor_of, results))}
    made = [f"by {len(codes)} versions of the code"] if len(codes) > 1 else []
    made += [f"on {len(processors)} kinds of processor"] if len(processors) > 1 else []
    told = _AS_TOLD.format(f", played {' '.join(made)}" if made else "")
    return _TRIAL if results[0].quick else told, *tag_notes(each.tags for each in results)


def is_beyond(result: BenchmarkResult) -> bool:
    """Whether no car can have the policy."""
    return bool({*result.tags} & {*MARKS}) or result.entry.policy == "full"


def _line(
    result: BenchmarkResult, name: str, number: str, control: BenchmarkResult | None
) -> TableRow:
    return (
        number,
        name,
        f"{result.score().mean:.1f} {bounds(result.score(), 1)}",
        *(f"{result.part_score(part):.1f}" for part in result.parts),
        f"{result.score(IDEAL).mean:.1f}",
        *(() if control is None else ("" if result is control else _shown(result.lead(control)),)),
    )


def _shown(lead: Interval) -> str:
    text = f"{lead.mean:+z.1f} {bounds(lead, 1)}"
    return Bold(text) if lead.low > 0 or lead.high < 0 else text
