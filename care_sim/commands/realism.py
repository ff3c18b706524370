"""`care-sim realism`: which orders of the headline tables hold under realistic conditions."""

from dataclasses import dataclass

from care_sim.base.checks import check_known
from care_sim.base.errors import report_problems
from care_sim.commands.shared.options import seeds_of
from care_sim.commands.shared.protocol_variants import ProtocolVariants
from care_sim.commands.shared.selection import check_values, expanded
from care_sim.sources.scenes import chosen_scenes
from care_sim.study.designs.realism import (
    FILM_BUDGETS,
    FILM_POLICIES,
    HEADLINES,
    Headline,
    film_conditions,
    headline_conditions,
    realism_plays,
    realism_study,
)


@dataclass(frozen=True, kw_only=True)
class Realism(ProtocolVariants):
    """Tell which orders of policies a real car's sensing keeps.

    Play the headline tables under the conditions of a real car, with --source that of first
    sightings, and tell which orders of policies hold, are lost or flip.

    Conditions that a budget, a set-up or a recording does not allow are left out; a line names
    each.
    """

    seeds: tuple[int, ...] = (10,)
    """One number: that many seeds, from 0. Several numbers: these seeds, of one split; 7 7 is seed
    7 alone. Drives play the seeds 100 further on, Euro NCAP tests the first seed alone.
    """
    tables: tuple[str, ...] = ("all",)
    """Without --source: which headline tables are played, of dartout-10, dense-3, dense-5,
    cutin-10, ncap-1, ncap-3 and drive-1 (scenario and budget); `all` stands for all of them. A
    quick look is --tables dense-3 --seeds 1.
    """
    also: tuple[str, ...] | None = ()
    """Further policies, installed ones too, that are played beside those of the headline tables."""
    policies: tuple[str, ...] = FILM_POLICIES
    """With --source: names of `care-sim policies`; `all` stands for all but the controls. `full`
    always runs with budget 1.0.
    """
    budgets: tuple[float, ...] = FILM_BUDGETS
    """With --source: shares of the cells that may fire at a keyframe, above 0 and at most 1."""

    def __call__(self) -> int:
        """Run it."""
        self.check_options()
        if self.source is not None:
            return self._play_source(self.source)
        seeds = seeds_of(self.seeds)
        headlines = self._headlines()
        also, left_out = self.further_policies()
        configs = realism_study(seeds, also, headlines)
        report_problems(
            [line for headline in headlines for line in headline_conditions(headline).left_out]
        )
        return self.play_study("realism", configs, self.name_of("realism"), left_out)

    def _headlines(self) -> list[Headline]:
        """Those that are named, in their order."""
        check_values(self, "tables")
        known = {headline.option: headline for headline in HEADLINES}
        named = expanded(self.tables, known)
        for name in named:
            check_known("table", name, known)
        return [headline for headline in HEADLINES if headline.option in named]

    def _play_source(self, named: str) -> int:
        source = self.source_named(named)
        scenes = chosen_scenes(source.scenes(), self.scenes)
        report_problems(
            [
                line
                for budget in self.budgets
                for line in film_conditions(source, scenes, budget).left_out
            ]
        )
        return self.play_scenes("realism-open-loop", "realism", realism_plays, named)
