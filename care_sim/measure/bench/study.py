"""The paper's closed-loop study, from the start of its workers to the last row."""

import time

from care_sim.study.designs.paper import paper_study
from care_sim.study.episode_play import play_episodes
from care_sim.study.executors import processes

WORKERS = 2


def study(seeds: int) -> dict[str, float]:
    """`episodes` of that many seeds, and the `seconds` that two workers take. Raises RuntimeError
    when one fails.
    """
    configs = paper_study(range(seeds))
    started = time.perf_counter()
    with processes(WORKERS) as pool:
        answers = [
            answer
            for batch in pool.map(play_episodes, [[config] for config in configs])
            for answer in batch
        ]
    seconds = time.perf_counter() - started
    for failed in (answer for answer in answers if isinstance(answer, str)):
        raise RuntimeError(failed)
    return {"episodes": float(len(answers)), "seconds": seconds}
