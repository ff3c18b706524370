"""The mechanism of a scene: one row per policy, of its own play and of the shared belief."""

import time
from collections.abc import Sequence

import care_sim
from care_sim.evaluation.allocation_differences import allocation_difference
from care_sim.evaluation.ray_shares import RAY_SHARES
from care_sim.evaluation.sightings import Sightings
from care_sim.study.accounted_play import Account, account_play
from care_sim.study.episode_play import peak_rss_mb, result_or_reason
from care_sim.study.mechanism_config import MechanismConfig
from care_sim.study.run_config import FULL, Row
from care_sim.study.scene_play import film_hash
from care_sim.study.shared_belief import SharedBelief, share_belief

ACCOUNT_COLUMNS = ("ttfds", "misses", "tracked", *(f"rays_{share}" for share in RAY_SHARES))
"""What every row says of the events of its own play, in order."""
DIFFERING = ("differing_keyframes", "differing_cells")
"""What a policy that was asked has, and the driver has not."""
RECEIVED = "received"
"""Of every new object of the shared belief, the cells that the policy would give it."""
BELIEF_SUMS = ("filled", "filled_rho", "explained_cells", "untaken_cells")
"""Sums over keyframes that the row of the driver has: those of `ReserveUse`."""
BELIEF_MARKS = ("pictured", "falsely_explained", "covered")
"""What it says of every new object, 1 or 0."""


def play_mechanism(batch: Sequence[MechanismConfig]) -> list[Row | str]:
    """What a worker does: the plays of one scene; of each its row, or in one line why there is
    none.
    """
    scene = result_or_reason(MechanismScene, batch)
    if isinstance(scene, str):
        return [scene] * len(batch)
    return [result_or_reason(scene.row, config, len(batch)) for config in batch]


class MechanismScene:
    """A scene whose driver has played and all others were asked.

    Raises InvalidInput where the film of the scene cannot be made.
    """

    def __init__(self, batch: Sequence[MechanismConfig]):
        started = time.perf_counter()
        config = batch[0]
        self._film = config.film()
        self._film_hash = film_hash(self._film)
        shown = [shot.annotations for shot in self._film.shots]
        self._sightings = Sightings.of(
            self._film.name, shown, hidden=self._film.hidden, presence=config.presence
        )
        # The full scan is a bound, with a budget of its own, and nobody to be asked.
        budgeted = [one for one in batch if one.policy != FULL]
        self._shared = self._share(budgeted) if budgeted else None
        self._shared_s = time.perf_counter() - started

    def row(self, config: MechanismConfig, sharers: int = 1) -> Row:
        """The row of a policy; `docs/columns.md` explains its columns.

        `wall_s` holds the share of the film, and of the shared belief, that falls to one of so many
        rows.
        """
        started = time.perf_counter()
        account = account_play(config, self._film, self._sightings)
        return {
            **config.row(),
            "version": care_sim.__version__,
            "digest": config.digest(),
            "film_hash": self._film_hash,
            "keyframes": account.keyframes,
            **_account_columns(account),
            **self._asked_columns(config),
            **self._belief_columns(config),
            "wall_s": time.perf_counter() - started + self._shared_s / sharers,
            "peak_rss_mb": peak_rss_mb(),
        }

    def _share(self, budgeted: Sequence[MechanismConfig]) -> SharedBelief:
        driver = budgeted[0].changed(policy=budgeted[0].driver, policy_parameters=())
        others = [config for config in budgeted if config.policy != driver.policy]
        return share_belief(driver, others, self._film, self._sightings)

    def _asked_columns(self, config: MechanismConfig) -> Row:
        columns: Row = dict.fromkeys((*DIFFERING, RECEIVED))
        shared = self._shared
        if shared is None or config.policy == FULL:
            return columns
        columns[RECEIVED] = tuple(shared.received[config.policy])
        if config.policy == config.driver:
            return columns
        moved = allocation_difference(shared.fired[config.policy], shared.fired[config.driver])
        return columns | dict(zip(DIFFERING, (moved.differing, moved.cells), strict=True))

    def _belief_columns(self, config: MechanismConfig) -> Row:
        shared = self._shared
        if shared is None or config.policy != config.driver:
            return dict.fromkeys((*BELIEF_SUMS, *BELIEF_MARKS))
        seen = [new.appearance for new in shared.entries]
        return {name: getattr(shared.reserve, name) for name in BELIEF_SUMS} | {
            "pictured": tuple(int(bool(each.wedges)) for each in seen),
            "falsely_explained": tuple(int(each.falsely_explained) for each in seen),
            "covered": tuple(int(new.covered) for new in shared.entries),
        }


def _account_columns(account: Account) -> Row:
    rays = account.rays.T.tolist()
    lists = (account.delays, account.reasons, account.tracked, *rays)
    return dict(zip(ACCOUNT_COLUMNS, map(tuple, lists), strict=True))
