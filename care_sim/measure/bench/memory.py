"""Memory of a worker of the studies, which begins episode after episode."""

from care_sim.measure.bench.config import BenchConfig
from care_sim.measure.bench.driven import driven
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import peak_rss_mb
from care_sim.study.executors import processes

Memory = dict[str, float]


def worker_memory(config: BenchConfig) -> Memory:
    """Peak memory in MB of a worker: `begun_mb` when it has begun one, `early_mb` after a tenth of
    the resets, `peak_mb` after all of them, `resets` in number. A step follows every reset.
    """
    with processes(1) as pool:
        return pool.submit(_resets, config.episode, config.resets).result()


def _resets(config: EpisodeConfig, resets: int) -> Memory:
    memory = {"resets": float(resets)}
    with driven(config) as env:
        for number in range(resets):
            env.reset(seed=config.seed + number)
            env.step(0)
            if number == 0:
                memory["begun_mb"] = peak_rss_mb()
            if number == resets // 10:
                memory["early_mb"] = peak_rss_mb()
    return {**memory, "peak_mb": peak_rss_mb()}
