"""The diagnosis as the groups of `schemas/diagnosis.py`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from r2s2r_cli.artifact import Group
from r2s2r_cli.stages.diagnose.diagnosis import Diagnosis
from schemas.robot import Robot


def diagnosis_groups(found: Diagnosis, robot: Robot) -> dict[str, Group]:
    """All groups by path."""
    which = found.which
    groups = {
        "verdict": Group(attributes={
            "robot": found.robot, "verdict": which.verdict, "effects": " ".join(which.effects),
            "probability": which.probability, "set90": " ".join(which.set90), "calibrated": which.calibrated,
            "floor": found.floor.rmse, "floor_from": found.floor.words, "chance": which.chance,
            "within_run": found.within_run,
        }),
        "ranking": _ranking(found), "sizes": _sizes(found), "screening": _screening(found),
        "segments": _segments(found, robot), "robot": _robot(robot),
    }  # fmt: skip
    if found.much is not None and found.much.names:
        root = {name: np.sqrt(value) for name, value in found.much.squared.items()}
        absent = np.full(len(found.much.names), np.nan)
        groups["judged"] = Group({
            "name": _texts(found.much.names),
            **{name: root.get(name, absent) for name in ("nominal", "refit", "effect", "ceiling")},
        })  # fmt: skip
    if found.where is not None and found.where.place is not None:
        place = found.where.place
        groups["place"] = Group({
            "x": place.x, "y": place.y, "value": np.where(np.isfinite(place.value), place.value, np.nan),
            "weight": np.nan_to_num(place.weight),
        })  # fmt: skip
    return groups


def _ranking(found: Diagnosis) -> Group:
    rows = found.which.ranking
    return Group({
        "name": _texts([one.effect for one in rows]),
        "elpd_gain": np.nan_to_num(np.array([one.gain for one in rows]), neginf=-1e9),
        "marginal": _finite([one.marginal if one.fitted and one.size else np.nan for one in rows]),
        "parity": np.array([one.parity for one in rows], dtype=float),
        "probability": np.array([one.probability for one in rows]),
        "rmse": np.array([np.nan if one.rmse is None else one.rmse for one in rows], dtype=float),
        "element": _texts(["" if one.element is None else one.element.words() for one in rows]),
        "channel": _texts([one.channel or "" for one in rows]),
    })  # fmt: skip


def _sizes(found: Diagnosis) -> Group:
    rows = [
        (name, value, *one.ci90[name], one.units[name])
        for one in found.which.ranking for name, value in one.size.items()
    ]  # fmt: skip
    numbers = np.array([row[1:4] for row in rows], dtype=float).reshape(-1, 3)
    return Group({
        "name": _texts([row[0] for row in rows]), "value": numbers[:, 0], "lower": numbers[:, 1],
        "upper": numbers[:, 2], "unit": _texts([row[4] for row in rows]),
    })  # fmt: skip


def _screening(found: Diagnosis) -> Group:
    rows = found.which.screened
    gain = np.array([one.gain for one in rows], dtype=float)
    return Group({
        "name": _texts([one.effect + ("" if one.element is None else f", {one.element.words()}") for one in rows]),
        "gain": np.where(np.isfinite(gain), gain, np.nan), "absorbed": np.array([one.absorbed for one in rows]),
        "seen": np.array([one.seen for one in rows]),
    })  # fmt: skip


def _segments(found: Diagnosis, robot: Robot) -> Group:
    rows = found.segments
    caps = robot.n_caps
    return Group({
        "run": _texts([one.run for one in rows]), "interval": np.array([one.interval for one in rows], dtype=np.int64),
        "t": np.array([one.t for one in rows]).reshape(-1, 2), "refit": _finite([one.refit for one in rows]),
        "effect": _finite([np.nan if one.effect is None else one.effect for one in rows]),
        "misfit": _finite([one.misfit for one in rows]), "gap": np.array([one.gap for one in rows], dtype=bool),
        "xy": np.array([one.key[:, :2] for one in rows]).reshape(-1, caps, 2),
        "error": np.array([one.error for one in rows]).reshape(-1, caps, 3),
    })  # fmt: skip


def _robot(robot: Robot) -> Group:
    return Group({
        "p_WE": np.array(robot.rest_caps_m), "cable": np.array([cable.caps for cable in robot.cables], dtype=np.int64),
        "actuated": np.array([k in robot.actuated for k in range(len(robot.cables))]),
    })  # fmt: skip


def _finite(values: Sequence[float]) -> np.ndarray:
    found = np.array(values, dtype=float)
    return np.where(np.isfinite(found), found, np.nan)


def _texts(words: Sequence[str]) -> np.ndarray:
    return np.array([word.encode() for word in words], dtype=bytes) if words else np.zeros(0, dtype="S1")
