"""Options of commands about results: the benchmark, its tables, reports, detectors, datasets."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from care_sim.base.checks import LARGEST_INTEGER, bounded, check_fields, check_whole
from care_sim.base.errors import InvalidInput
from care_sim.certify import ALL_EPISODES
from care_sim.commands.options.shared import (
    EpisodeOptions,
    Flag,
    PlayOptions,
    PolicyOptions,
    SceneOptions,
    SourceOptions,
    WorkerOptions,
)
from care_sim.core.defaults import AS_DEMANDED

_MOST_EPISODES = 100_000
"""As many as a study may have."""
_MOST_STREETS = 1_000
"""A draw of more would be a study."""


def _refuse(*cases: tuple[object, str]) -> None:
    """Raise InvalidInput with the text of the first case that is true."""
    for wrong, told in cases:
        if wrong:
            raise InvalidInput(told)


@dataclass(frozen=True, kw_only=True)
class Benchmark(WorkerOptions):
    """Play the benchmark: B90, how few cells are enough.

    B90 is the smallest budget at which a policy has 90% of what a full scan has, on every count.
    Streets are played at seven budgets: 560 plays per entry, 168 with --quick. The command writes a
    result file per entry and a figure, and prints a line per entry beside the published entries.
    """

    policy: tuple[str, ...] = ()
    """Names of `care-sim list policies`, or MODULE:OBJECT for one of a file here, such as mine:Mine
    of mine.py; `all` stands for all but the controls."""
    policy_parameters: tuple[str, ...] = ()
    """Parameters of the policies as NAME=VALUE; for one of several as POLICY.NAME=VALUE."""
    cell_order: str = AS_DEMANDED
    """In which order the cells of a set are taken, a part of the entry: the policy's own, or one of
    rows-down, rows-up, columns, random, spread, core-spread."""
    name: str = ""
    """Name of the entry in tables, if a single policy is played."""
    detector: str = "centerpoint"
    """The detector. Entries are ranked under centerpoint. Published entries on streets are printed
    beside results under megvii, pointrcnn and returns too, and with --quick under cluster and
    pillars."""
    detector_parameters: tuple[str, ...] = ()
    """Parameters of the detector as NAME=VALUE. Published entries have none."""
    closed_loop: Flag = False
    """Play 24 drives, 40 Euro NCAP tests and 80 tight tests too, which a full scan only just
    passes. Collisions avoided and needless stops then count as well."""
    recorded: tuple[str, ...] = ()
    """Play recorded drives too, as parts of their own. nuscenes:FOLDER, argoverse2:FOLDER,
    kitti:FOLDER, boreas (comes with the package), or a source of your own."""
    without_streets: Flag = False
    """With --recorded: play no streets."""
    quick: Flag = False
    """Play the first 24 streets alone: a trial."""
    fresh: int = bounded(0, 0, _MOST_STREETS)
    """Play this many streets that nobody has played, drawn by lot from seeds 2147483648 to
    4294967295. The folder keeps the draw: further entries meet the same streets."""
    sealed: Path | None = None
    """For organisers of a competition: a file with a secret salt, which draws the streets. The
    journal in the folder holds their seeds; the result files do not."""
    out: Path = Path("runs/benchmark")
    """Folder of the result files; what is finished stays there, and the same command resumes."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _refuse(
            (
                self.fresh and (self.quick or self.sealed),
                "fresh streets are neither the published nor sealed ones: remove quick and sealed",
            ),
            (
                (self.closed_loop or self.recorded) and (self.fresh or self.sealed),
                "fresh and sealed worlds are streets alone: remove closed_loop and recorded",
            ),
            (
                self.without_streets and not self.recorded,
                "without_streets leaves nothing to play: give recorded too",
            ),
            (
                self.sealed and self.out == Benchmark.out,
                "a sealed set leaves its seeds in the folder: give --out a folder that only you "
                "read",
            ),
        )


@dataclass(frozen=True, kw_only=True)
class Leaderboard(WorkerOptions):
    """Put result files in a table, or verify them.

    Published entries stand beside them, in the same worlds under the same detector. To verify a
    file is to play a random tenth of every part again, at least five worlds.
    """

    results: Annotated[
        tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="RESULTS...")
    ] = ()
    """Result files, or folders of them; without any, the published entries alone. If two have one
    name and code, the first counts."""
    verify: Flag = False
    """Play a random tenth of the worlds of every result again, instead of a table. Their policies
    must be installed here."""
    sealed: Path | None = None
    """With --verify: the file with the salt of sealed results."""
    recorded: tuple[str, ...] = ()
    """With --verify: the sources of the recorded drives, as for benchmark."""
    out: Path = Path("runs/leaderboard")
    """Folder for the page and the figures. A page that is there already is replaced, and a line
    says so."""

    def __post_init__(self) -> None:
        super().__post_init__()
        _refuse(
            (
                self.sealed and not self.verify,
                "sealed is for results that are verified: give verify too",
            ),
            (
                self.recorded and not self.verify,
                "recorded is for results that are verified: give verify too",
            ),
            (self.verify and not self.results, "name the results to verify"),
        )


@dataclass(frozen=True, kw_only=True)
class Report(SourceOptions, WorkerOptions):
    """Print a folder's tables and figures again, or make one page.

    Several folders of one study are put into a new one, with tables and figures of them all: what
    you played stands beside what was published, seed by seed. A task that two folders hold is kept
    once, and must have the same result.
    """

    folders: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER...")]
    """The --out of an earlier study; several of one name are merged."""
    out: Path | None = None
    """For several folders: a folder that does not exist, or is empty; runs/merge unless given."""
    page: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """HTML file for the page, which needs no other file; the folder stays as it is."""
    minus: str | None = None
    """Print this policy less each of the others, with intervals, instead of the tables; the folder
    stays as it is. A policy with parameters has its whole name in the tables."""
    verbose: bool = False
    """Print all tables."""
    episodes: int = bounded(40, 0, LARGEST_INTEGER)
    """At most this many episodes are played again for the page, seed by seed; 0 for none. They take
    as long as they did in the study."""
    source: str | None = None
    """Where the recordings are that a study of the open loop played, for its page:
    argoverse2:FOLDER, nuscenes:FOLDER, kitti:FOLDER, sweeps:FOLDER, boreas, or a source of your
    own. Streets need none."""

    def __post_init__(self) -> None:
        super().__post_init__()
        given = [name.replace("_", "-") for name in self.source_options()]
        _refuse(
            (not self.folders, "report needs the folder of a study, its --out"),
            (
                len(self.folders) == 1 and self.out,
                "--out is for several folders; the report of one stays in it",
            ),
            (
                len(self.folders) > 1 and (self.page or self.minus is not None),
                "--page and --minus take one folder: merge several first, then report --out",
            ),
            (not self.source and given, f"--{''.join(given[:1])} has no meaning without --source"),
            (
                self.source and not (self.page and self.episodes),
                "--source has no meaning without --page and --episodes: nothing is played again",
            ),
            (
                self.minus is not None and self.page,
                "--minus has no meaning with --page: a page draws its own pairs",
            ),
        )


@dataclass(frozen=True, kw_only=True)
class Judge(SceneOptions, WorkerOptions, PolicyOptions):
    """Judge detectors: what they find, and how much of it is right.

    They are judged on full scans, or on those of a policy: what they find, how much of it is right,
    how sure they may be, how long they take.
    """

    detectors: tuple[str, ...] = ("returns", "cluster", "pillars")
    """Names of `care-sim list detectors`, instead of --detector. Give a parameter of one as
    DETECTOR.NAME=VALUE, such as pillars.least_score=0.02."""
    least_scores: tuple[float, ...] = (0.3, 0.5)
    """For a detector with scores: what is less sure is left out, once for each of these. Its curve
    shows all that it reports."""
    against: str = "cluster"
    """The detector at whose precision the others are compared with it."""
    policy: str = "full"
    budget: float = 1.0
    out: Path = Path("runs/judge")
    """Folder of tables, figure and numbers."""
    official: Flag = False
    """Write all boxes, too, in the form that the official nuScenes devkit scores."""
    force: Flag = False
    """Replace what such a command wrote there."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for score in self.least_scores:
            if not 0 <= score <= 1:
                raise InvalidInput(f"least_scores must be from 0 to 1, got {score:g}")


@dataclass(frozen=True, kw_only=True)
class ExportNuScenes(PlayOptions, PolicyOptions):
    """Write a policy's detections for the official nuScenes devkit.

    The policy plays over nuScenes scenes; its detections are in the results form of the devkit.
    """

    source: str = tyro.MISSING
    """nuscenes:FOLDER, the folder of a nuScenes v1.0 database."""
    out: Path
    """The results file, JSON."""


@dataclass(frozen=True, kw_only=True)
class ExportMinari(EpisodeOptions, PolicyOptions):
    """Write a policy's episodes as a Minari dataset.

    The dataset is for offline learning. It holds observations, actions, rewards, seeds and the
    environment. Every episode has a training seed.
    """

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO")]
    """dartout, dense, cutin, ncap, r157, drive, that of an installed package, or MODULE:CLASS;
    `care-sim list scenarios` lists their parameters."""
    dataset: str = tyro.MISSING
    """The id for `minari.load_dataset`, for example care-sim/dense/care-v0. Minari stores datasets
    in the folder MINARI_DATASETS_PATH, or else in ~/.minari/datasets."""
    episodes: int = bounded(20, 1, _MOST_EPISODES)
    """Episodes to play, on the training seeds from 10000 on."""

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, kw_only=True)
class Certify(WorkerOptions):
    """Play published episodes and say whether they go as published.

    Play a published list of episodes and say whether they go as published, or where one does
    not.

    The list holds every environment, built-in policy, fault, measured detector and driver. It takes
    some minutes.
    """

    all: Flag = False
    """All 10,000 episodes, not only the first 3,600."""
    episode: int | None = None
    """This episode alone, by its number in the list."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.episode is not None:
            check_whole("episode", self.episode, 0, ALL_EPISODES - 1)
            _refuse((self.all, "--episode plays one episode: leave --all out"))
