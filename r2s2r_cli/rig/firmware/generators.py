"""A random generator for every part of the rig's electronics, each from the world's seed and a name of its own."""

from __future__ import annotations

import zlib

import numpy as np

from r2s2r_cli.rig.world.file import World


def generator(world: World, name: str) -> np.random.Generator:
    """The same for the same seed and name; parts that are added later do not change what the others draw."""
    return np.random.default_rng([world.seed, zlib.crc32(name.encode())])
