"""The leaderboard: results of the benchmark in a table, and the page that explains it."""

from collections import Counter
from collections.abc import Sequence

from care_sim.base.errors import counted
from care_sim.evaluation.bootstrap import Interval
from care_sim.reports.formatting import MARKS, bounds, marked, tag_notes
from care_sim.reports.table import Bold, Table, TableRow
from care_sim.study.benchmark.result import BenchmarkResult, code_of, processor_of
from care_sim.study.benchmark.suite import BENCHMARK_VERSION, CAMERAS, IDEAL, Entry
from care_sim.study.run_config import FULL

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
    rows: list[TableRow] = []
    place = 0
    for name, each in named:
        # What no car can have stands where its score puts it, and takes no place.
        is_beyond = bool({*each.tags} & {*MARKS}) or each.entry.policy == FULL
        place += not is_beyond
        score = f"{each.score().mean:.1f} {bounds(each.score(), 1)}"
        shares = (each.part_score(part) for part in each.parts)
        lead = [] if control is None else ["" if each is control else _shown(each.lead(control))]
        rows.append(
            (
                "" if is_beyond else f"{place}",
                name,
                score,
                *(f"{share:.1f}" for share in (*shares, each.score(IDEAL).mean)),
                *lead,
            )
        )
    leads = () if control is None else (f"minus {minus}",)
    # The leads are the widest: at 80 characters all but they stand side by side.
    columns = ("", "policy", "score", *results[0].parts, "ideal camera", *leads)
    return Table(
        _title(results), columns, tuple(rows), _notes(results), whole=("", "score"), names=2
    )


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
    title = f"{_title(results)}: minus {minus}, part by part"
    return Table(title, columns, rows, (_TRIAL if control.quick else _IN_HINDSIGHT,))


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
    names = (
        f"{each.entry.name} #{each.made_by.get('policy_code', '')[:7]}"
        if times[each.entry.name] > 1
        else each.entry.name
        for each in results
    )
    return [marked(name, each.tags) for name, each in zip(names, results, strict=True)]


def _title(results: Sequence[BenchmarkResult]) -> str:
    """Version, and which worlds."""
    sealed = results[0].sealed
    worlds = len(results[0].rows) // len(CAMERAS)
    of = f"sealed by {sealed[:12]}" if sealed else "published"
    return f"CARE-Sim benchmark {BENCHMARK_VERSION}: {counted(worlds, 'world')}, {of}"


def _notes(results: Sequence[BenchmarkResult]) -> tuple[str, ...]:
    """Return notes on who vouches for the numbers, and on the marks."""
    codes = {*filter(None, map(code_of, results))}
    processors = {*filter(None, map(processor_of, results))}
    made = [f"by {len(codes)} versions of the code"] if len(codes) > 1 else []
    made += [f"on {len(processors)} kinds of processor"] if len(processors) > 1 else []
    told = _AS_TOLD.format(f", played {' '.join(made)}" if made else "")
    return _TRIAL if results[0].quick else told, *tag_notes(each.tags for each in results)


def _shown(lead: Interval) -> str:
    text = f"{lead.mean:+z.1f} {bounds(lead, 1)}"
    return Bold(text) if lead.low > 0 or lead.high < 0 else text
