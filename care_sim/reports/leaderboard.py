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
_SCORE = (
    "Score: of what a full scan reaches in the same worlds, the share that the policy reaches with "
    "1% of the cells, in percent: the mean of collisions avoided in drives, collisions avoided in "
    "Euro NCAP tests, and first sightings found at once on streets, with a camera that errs as "
    "YOLOX was measured to. In brackets the 95% interval over worlds."
)
_MINUS = "Minus {}: points over {}, paired by world; bold where the interval excludes zero."
_OF_CONTROL = f"the control {CONTROL.name}, a fixed map without a camera"
_IDEAL = "Ideal camera: the score with a camera that reports whatever shows enough pixels."
_UNRANKED = "No number: no policy that a car can have."
_AS_TOLD = "As the files say{}: care-sim leaderboard --verify plays a tenth of a file again."
_LEADS_BY_PART = (
    "Points, paired by world; bold where the interval excludes zero. The score weighs its parts "
    "alike, a convention on which it hangs who leads of two that are ahead in one part each."
)
_IN_HINDSIGHT = (
    "Who is first is chosen by the very results that are compared, which favours the first; the "
    "number of comparisons is not corrected for."
)
_TRIAL = (
    "Only the tenth of the worlds that --quick plays: a trial, and no leaderboard. So few worlds "
    "may all end alike by chance, and then the interval has no width."
)


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
    notes = notes_on(results, minus if leads else "")
    return Table(title(results), columns, rows, notes, whole=("", "score"), names=2)


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
    trial = (_TRIAL,) if control.quick else ()
    columns = ("policy", *control.parts, "score, ideal camera")
    title_of_leads = f"{title(results)}: minus {minus}, part by part"
    return Table(title_of_leads, columns, rows, (*trial, _LEADS_BY_PART, _IN_HINDSIGHT))


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


def notes_on(results: Sequence[BenchmarkResult], minus: str) -> tuple[str, ...]:
    """What the columns and marks mean; without `minus` there are no leads."""
    over = _OF_CONTROL if minus == CONTROL.name else minus
    leads = (_MINUS.format(minus, over),) if minus else ()
    beyond = (_UNRANKED,) if any(map(is_beyond, results)) else ()
    trial = (_TRIAL,) if results[0].quick else ()
    codes = {*filter(None, map(code_of, results))}
    processors = {*filter(None, map(processor_of, results))}
    made = [f"by {len(codes)} versions of the code"] if len(codes) > 1 else []
    made += [f"on {len(processors)} kinds of processor"] if len(processors) > 1 else []
    told = _AS_TOLD.format(f", played {' '.join(made)}" if made else "")
    tags = tag_notes(each.tags for each in results)
    # What limits the numbers comes first: a terminal has room for three lines.
    return (*trial, told, _SCORE, *leads, _IDEAL, *beyond, *tags)


def is_beyond(result: BenchmarkResult) -> bool:
    """Whether no car can have the policy."""
    return bool({*result.tags} & {*MARKS}) or result.entry.policy == "full"


def _line(
    result: BenchmarkResult, name: str, number: str, control: BenchmarkResult | None
) -> TableRow:
    return (
        number,
        name,
        _with_ends(result.score()),
        *(f"{result.part_score(part):.1f}" for part in result.parts),
        f"{result.score(IDEAL).mean:.1f}",
        *(() if control is None else (_lead(result, control),)),
    )


def _lead(result: BenchmarkResult, control: BenchmarkResult) -> str:
    if result is control:
        return ""
    return _shown(result.lead(control))


def _shown(lead: Interval) -> str:
    text = f"{lead.mean:+z.1f} {bounds(lead, 1)}"
    return Bold(text) if lead.low > 0 or lead.high < 0 else text


def _with_ends(interval: Interval) -> str:
    return f"{interval.mean:.1f} {bounds(interval, 1)}"
