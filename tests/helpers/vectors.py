"""A vector environment played beside the single environments that it stands for."""

from functools import partial

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import care_sim
from care_sim.envs.vector.arguments import OF_EACH_WORLD

MODES = tuple(mode.value for mode in AutoresetMode)


def native(name, worlds, **arguments):
    """The vector environment of CARE-Sim."""
    return gymnasium.make_vec(
        f"care_sim:{name}",
        num_envs=worlds,
        vectorization_mode="vector_entry_point",
        **arguments,
    )


class _Own(SyncVectorEnv):
    """Single environments whose arrays in infos may differ in their lengths."""

    def _add_info(self, vector_infos, env_info, env_num):
        for name, value in env_info.items():
            if isinstance(value, np.ndarray):
                vector_infos.setdefault(name, np.full(self.num_envs, None, object))
        return super()._add_info(vector_infos, env_info, env_num)


def singles(name, worlds, mode, **arguments):
    """Gymnasium's vector of single environments. Each environment takes its own value of arguments
    that are lists.
    """
    own = {name: arguments[name] for name in OF_EACH_WORLD if isinstance(arguments.get(name), list)}
    each = [
        arguments | {name: values[world] for name, values in own.items()} for world in range(worlds)
    ]
    makers = [partial(gymnasium.make, f"care_sim:{name}", **given) for given in each]
    kind = _Own if len({*own.get("budget", [])}) > 1 else SyncVectorEnv
    return kind(makers, autoreset_mode=AutoresetMode(mode))


def difference(one, other, place=""):
    """Where two trees of dictionaries, arrays and numbers differ in a bit; None nowhere."""
    if isinstance(one, dict) and isinstance(other, dict):
        if one.keys() != other.keys():
            return f"{place}: {sorted(one.keys() ^ other.keys())}"
        parts = (difference(one[key], other[key], f"{place}/{key}") for key in one)
        return next(filter(None, parts), None)
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        if (one.dtype, one.shape) != (other.dtype, other.shape):
            return f"{place}: {one.dtype} {one.shape}, {other.dtype} {other.shape}"
        if one.dtype == object:
            return difference(*(dict(enumerate(table.ravel())) for table in (one, other)), place)
        return None if one.tobytes() == other.tobytes() else f"{place}: {one} {other}"
    same = type(one) is type(other) and (one == other or (one != one and other != other))
    return None if same else f"{place}: {one!r} {other!r}"


def played_alike(
    name, worlds, steps, *, mode="NextStep", threads=1, policy="care", seed=3, **arguments
):
    """The first difference between both over `steps` steps from a seed on, None without one. Every
    fifth action of world 0 is at random. Worlds that are over begin anew.
    """
    vector = native(name, worlds, threads=threads, autoreset_mode=mode, **arguments)
    reference = singles(name, worlds, mode, **arguments)
    rng = np.random.default_rng(0)
    try:
        policies = [care_sim.make_policy(policy, env.unwrapped) for env in reference.envs]
        given, expected = vector.reset(seed=seed), reference.reset(seed=seed)
        found = difference(
            dict(zip("oi", given, strict=True)), dict(zip("oi", expected, strict=True))
        )
        for step in range(steps):
            if found:
                return f"before step {step}: {found}"
            observation = given[0]
            actions = np.stack(
                [
                    one({key: rows[world] for key, rows in observation.items()})
                    for world, one in enumerate(policies)
                ]
            )
            if step % 5 == 4:
                actions[0] = rng.random(actions[0].shape, np.float32)
            given, expected = vector.step(actions), reference.step(actions)
            over = given[2] | given[3]
            if mode == "Disabled" and over.any():
                found = difference([*given][4], [*expected][4], "info")
                options = {"reset_mask": over}
                seeds = [7 * step + world for world in range(worlds)]
                given = (*vector.reset(seed=seeds, options=dict(options)), step)
                expected = (*reference.reset(seed=seeds, options=dict(options)), step)
            found = found or difference(
                dict(enumerate(given)), dict(enumerate(expected)), f"step {step}"
            )
        return found
    finally:
        vector.close()
        reference.close()
