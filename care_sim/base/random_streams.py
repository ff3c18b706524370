"""The independent streams of random numbers that an episode's seed holds, and how a secret closes
them.

Whoever holds this package can draw the episodes of a public seed, and find the seed of an episode
by what it begins with. A secret enters everything that is drawn: no observation then tells the
seed, nor a seed the episode, but what a guess among all that the ranges of a scenario allow tells.
NumPy's generators are not made for cryptography; to tell from the first numbers that a stream gave
those that follow is years of computing (Bouillaguet, Martinez and Sauvage, ToSC 2020, on PCG64), no
proof that it cannot be done.
"""

import hmac

import numpy as np

from care_sim.base.errors import InvalidInput


def streams(entropy: tuple[int, ...], count: int, secret: str = "") -> list[np.random.SeedSequence]:
    """`count` streams of an episode; `entropy` is its seed, and in the open loop a number of its
    scene's.
    """
    return np.random.SeedSequence(
        secret_entropy("episode", entropy, secret) if secret else entropy
    ).spawn(count)


def secret_entropy(what: str, entropy: tuple[int, ...], secret: str) -> int:
    """256 bits of what is drawn, its seed and a secret (HMAC-SHA-256), of which neither can be
    told. An episode and a street of one seed have nothing in common.
    """
    # As plain decimal numbers, so that an integer of NumPy gives what one of Python does.
    message = " ".join([what, *(str(int(number)) for number in entropy)])
    return int.from_bytes(hmac.digest(secret.encode(), message.encode(), "sha256"))


def check_secret(secret: object) -> None:
    """Raise InvalidInput unless it is False, for none, or a text that can be encoded. An empty text
    and None are what an environment variable gives that is not set; they would leave everything
    open.
    """
    if secret is False:
        return
    if not isinstance(secret, str):
        raise InvalidInput(f"secret must be a text, got one of type {type(secret).__name__}")
    if not secret:
        raise InvalidInput(
            "secret must not be empty: leave it out, or give False, where there is none"
        )
    if not secret.isascii():
        raise InvalidInput("secret must be of ASCII characters alone")
