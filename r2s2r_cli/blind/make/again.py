"""The hidden world of a label once more: drawn from its seed as it was when the set was made, and compared with it."""

from __future__ import annotations

import json
from dataclasses import asdict
from itertools import product
from typing import Any

from r2s2r_cli.blind.make.worlds import Hidden, hidden
from r2s2r_cli.blind.split import Bank, Kind
from r2s2r_cli.errors import InputError


def world_of(label: dict[str, Any], *, where: str) -> Hidden:
    """The world that a label is of.

    Whether the maker was told the number of gaits, the effects and the noise (`--gaits`, `--effect`, `--noise`) is in
    no label, and decides what else is drawn from the seed: each way is tried until one says what the label says.
    where: of the label, for people. Raises InputError where none does: another version of the maker made the set.
    """
    ids = tuple(str(one["id"]) for one in label["effects"])
    for effects, gaits, noise in product(
        dict.fromkeys(((), ids)), (None, int(label["gaits"])), dict.fromkeys((None, label["noise_m"]))
    ):
        found = hidden(
            Bank(label["bank"]), int(label["seed"]), Kind(label["kind"]), effects=effects, gaits=gaits,
            commissioning=int(label["commissioning"]), tier=label["tier"],
            camera=bool(label.get("camera", False)), noise_m=noise,
        )  # fmt: skip
        if _facts(found) == _told(label):
            return found
    raise InputError(
        "the world of this label cannot be made again", where=where, received="a world that differs from the label",
        expected="the version of r2s2r that made the bank (made_by in its index.json)",
        hint="r2s2r blind make bank --key labels.key",
    )  # fmt: skip


_DRAWN = ("factor", "friction", "speed", "tolerance", "noise_m", "ar1", "rate_hz", "gaits", "commissioning")


def _facts(world: Hidden) -> dict[str, Any]:
    """What a label says of a world, but for what comes out only when it is driven."""
    strange = world.strange
    facts = {
        **{name: getattr(world, name) for name in _DRAWN},
        **({"noise_m": None, "ar1": None} if world.camera else {}),
        "effects": [[one.id, one.table] for one in world.planted],
        "outside": None if strange is None else [strange[0], asdict(strange[1]), strange[2]],
    }
    return dict(json.loads(json.dumps(facts)))


def _told(label: dict[str, Any]) -> dict[str, Any]:
    outside = label["outside"]
    return {
        **{name: label[name] for name in _DRAWN},
        "effects": [[one["id"], one["table"]] for one in label["effects"]],
        "outside": None if outside is None else [outside["name"], outside["table"], outside["gait"]],
    }
