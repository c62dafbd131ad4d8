"""A small identification as a value: four parameters, one of each sort of trust, two segments of the run `walk`."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group, Scalar
from schemas.robot import Robot
from tests.support.motion import motion

NAMES = ("motor_speed", "friction", "damping", "restitution")
BASELINES = ("nothing moves", "repeat the same phase", "nominal", "refit of two parameters")
_NAN = float("nan")


def text(*words: str) -> np.ndarray:
    """Words as an artifact holds them."""
    return np.char.encode(np.array(words, dtype=str), "utf-8")


def identification(robot: Robot, frames: int = 24, *, repeating: bool = False) -> ArtifactData:
    """Numbers that fit together: intervals are value -+ 1.96 sd, covariances have the correlations, costs fall."""
    facts: dict[str, Scalar] = {
        "method": "default", "drive": "command replay", "loss": "key frames, robust beyond 3 sd", "robot": robot.name,
        "engine": "closed form 1", "effects": "", "step": 0.001, "seed": 0, "rollouts": 120, "cost": 21.0,
        "residuals": 36, "converged": True, "reason": "the step is small",
    }  # fmt: skip
    groups = {
        "fit": Group({}, facts), "parameters": parameters(), "covariance": _covariance(),
        "identifiability": _identifiability(), "trace": _trace(), "starts": _starts(), "profiles": _profiles(),
        "measures": _measures(), "history": _history(), **_of_motion(robot, frames, repeating),
    }  # fmt: skip
    return ArtifactData("identification", groups)


def parameters() -> Group:
    """Identified, identified, weak, not identifiable."""
    value, sd = np.array([0.8, 0.62, 4.0, 0.3]), np.array([0.01, 0.05, 3.0, _NAN])
    reason = text("", "", "the prior says more", "zero sensitivity: no cap bounced")
    return Group({
        "name": text(*NAMES), "unit": text("1", "1", "N s/m", "1"),
        "what": text("speed of all motors", "friction of the ground", "damping of all cables", "restitution"),
        "value": value, "sd": sd, "lower": value - 1.96 * sd, "upper": value + 1.96 * sd,
        "range": np.array([[0.79, 0.81], [0.58, 0.66], [1.0, 9.0], [_NAN, _NAN]]),
        "bounds": np.array([[0.1, 2.0], [0.05, 1.5], [_NAN, 50.0], [0.0, 0.95]]),
        "start": np.array([1.0, 0.76, 5.0, 0.3]), "prior_mean": np.array([1.0, 0.76, 5.0, 0.3]),
        "prior_sd": np.array([0.3, 0.5, 1.0, _NAN]), "coordinate": np.array([1, 1, 1, 2], np.uint8),
        "identifiable": np.array([True, True, True, False]), "trust": np.array([0, 0, 1, 2], np.uint8),
        "reason": reason,
    })  # fmt: skip


def _covariance() -> Group:
    correlation = np.full((4, 4), _NAN)
    correlation[:3, :3] = [[1.0, -0.4, 0.97], [-0.4, 1.0, -0.3], [0.97, -0.3, 1.0]]
    sd = np.array([0.0125, 0.08, 0.75, _NAN])
    return Group({"covariance": correlation * np.outer(sd, sd), "correlation": correlation})


def _identifiability() -> Group:
    turn = np.array([[0, 0, 0, 1.0], [0, 0, 1, 0], [0, 1, 0, 0], [1, 0, 0, 0]])
    return Group(
        {
            "column_norm": np.array([60.0, 7.0, 1.2, 0.0]), "eigenvalue": np.array([0.0, 0.5, 48.0, 3600.0]),
            "eigenvector": turn, "weak": np.array([True, True, False, False]),
            "words": text("restitution alone", "damping alone", "friction alone", "motor_speed alone"),
        },
        {"threshold": 1.0, "condition": 7200.0},
    )  # fmt: skip


def _trace() -> Group:
    cost = np.array([900.0, 200.0, 40.0, 22.0, 21.0, 700.0, 60.0, 21.5])
    path = np.array([1.0, 0.9, 0.85, 0.81, 0.8, 1.3, 0.9, 0.8])
    value = np.stack([path, 0.62 / 0.8 * path, 5 * path, np.full(8, 0.3)], axis=1)
    return Group({"start": np.array([0] * 5 + [1] * 3), "stage": text(*["1 segment"] * 2, *["all segments"] * 6),
                  "iteration": np.array([0, 1, 2, 3, 4, 0, 1, 2]), "cost": cost, "value": value})  # fmt: skip


def _starts() -> Group:
    first = np.array([[1.0, 0.76, 5.0, 0.3], [1.3, 0.5, 8.0, 0.3], [0.8, 0.62, 4.0, 0.3]])
    last = np.array([[0.8, 0.62, 4.0, 0.3], [0.8, 0.61, 4.4, 0.3], [0.805, 0.6, 2.0, 0.3]])
    return Group({"kind": np.array([0, 0, 1], np.uint8), "first": first, "last": last,
                  "cost": np.array([21.0, 21.5, 24.0]), "reason": text(*["the step is small"] * 3)})  # fmt: skip


def _profiles() -> Group:
    grid = np.array([[1.0, 2.0, 4.0, 8.0, 16.0], [0.5, 0.62, 0.74, _NAN, _NAN]])
    cost = np.array([[1.0, 0.4, 0.0, 0.4, 1.0], [2.9, 0.0, 2.9, _NAN, _NAN]])
    interval = np.array([[_NAN, _NAN], [0.52, 0.72]])
    return Group({"parameter": np.array([2, 1]), "value": grid, "cost": cost, "interval": interval,
                  "threshold": np.full(2, 1.92), "words": text("no end", "as wide")})  # fmt: skip


def _measures() -> Group:
    value = np.array([0.006, 0.008, 0.011])
    others = np.array([[0.05, 0.02, 0.02, 0.009], [0.048, 0.011, 0.02, 0.012], [0.05, _NAN, 0.03, 0.018]])
    spread = np.array([0.8, 1.3])
    return Group({
        "role": np.array([1, 2, 2], np.uint8), "metric": text(*["keyframe_cap_rmse"] * 2, "free_run_cap_mean"),
        "value": value, "interval": value[:, None] * spread, "floor": np.array([0.005, 0.005, _NAN]),
        "baseline": text(*BASELINES), "baseline_value": others, "baseline_interval": others[:, :, None] * spread,
    })  # fmt: skip


def _history() -> Group:
    value = np.array([[0.9, 0.7, 5.0, 0.3], [0.8, 0.62, 4.0, 0.3]])
    return Group(
        {"run": text("walk", "walk-2"), "value": value, "sd": np.array([[0.05, 0.1, 4, _NAN], [0.01, 0.05, 3, _NAN]])}
    )


def _of_motion(robot: Robot, frames: int, repeating: bool) -> dict[str, Group]:
    """What has end caps in it: two segments, observed with a ripple of 2 mm; the second is simulated 6 mm too far."""
    m = motion(robot, frames)
    half = frames // 2
    ripple = 0.002 * np.sin(40 * m.t)[:, None, None] * np.ones((6, 3))
    simulated = m.p_WE.copy()
    simulated[half:, :, 0] += 0.006 * np.linspace(0, 1, frames - half)[:, None]
    observed = m.p_WE + ripple
    fit = {"t": m.t, "interval": 1 + (np.arange(frames) >= half), "observed": observed, "simulated": simulated}
    error = (simulated - observed)[[half - 1, -1]]
    distance = np.linalg.norm(simulated - observed, axis=-1)
    rmse = np.sqrt(np.mean(distance[[half - 1, -1]] ** 2, axis=1))
    whole = [float(np.sqrt(np.mean(distance[part] ** 2))) for part in (slice(0, half), slice(half, None))]
    cables = len(robot.cables)
    stop = m.t[[half - 1, -1]]
    start = m.t[[0, half]]
    found = {
        "segments": Group({
            "run": text("walk", "walk"), "interval": np.array([1, 2]), "role": np.array([1, 2], np.uint8),
            "t_first": start, "t_last": stop, "keyframe_error": error, "keyframe_cap_rmse": rmse,
            "cap_rmse": np.array(whole),
            "baseline_cap_rmse": np.array([[0.05, _NAN, 0.02, 0.009], [0.048, 0.011, 0.02, 0.012]]),
            "lag1": np.tile([0.1, 0.2, 0.1, 0.0, -0.1, 0.7], (2, 1)), "white": np.tile([True] * 5 + [False], (2, 1)),
        }),
        "windows": Group({
            "run": text("walk"), "interval": np.array([1]), "t_first": m.t[:1], "t_last": m.t[half - 1 : half],
            "p_WE": m.p_WE[:1], "v_WE": np.zeros((1, 6, 3)), "shift": np.full((1, 6, 3), 0.001),
        }),
        "sites": Group({"p_RS": np.array([cable.sites_m for cable in robot.cables]).reshape(cables, 2, 3)}),
        "runs/walk": Group({}, {"robot": robot.name, "nature": "kinematic sample"}),
        "runs/walk/fit": Group(fit),
        "runs/walk/free_run": Group({
            "t": m.t[half:], "chain": np.zeros(frames - half, np.int64), "observed": observed[half:],
            "simulated": simulated[half:],
        }),
    }  # fmt: skip
    if repeating:
        free = found["runs/walk/free_run"]
        together = 0.5 * (simulated + observed)[half:]
        found["runs/walk/free_run"] = Group({**free.datasets, "predicted": together}, free.attributes)
        found["repeating"] = Group(
            {
                "run": text("walk"), "interval": np.array([2]), "repeats": np.array([2]), "weight": np.array([0.5]),
                "keyframe_error": 0.5 * error[1:], "keyframe_cap_rmse": 0.5 * rmse[1:],
            },
            {"used": False, "gap": 0.004, "floor": 0.005, "contrasts": 1, "dof": 5.0},
        )  # fmt: skip
    return found
