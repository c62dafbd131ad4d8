"""A calibration in closed form: what a perfect bench would have measured."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.artifact import Group

SLOPE, OFFSET = 2e-10, 4e-11
LENGTHS = np.array([0.10, 0.13, 0.16, 0.20])
K1, K2, K3 = np.array([300.0, 320.0]), np.array([-500.0, -400.0]), np.array([4000.0, 3000.0])


def bench_groups() -> dict[str, Group]:
    """The groups of a calibration: two sensors, two dated sets, two tendon curves, one weighed rod."""
    return {**_sensors(), **_history(), **_tendons(), **_rod()}


def _sensors() -> dict[str, Group]:
    sensor, length = np.repeat([0, 1], len(LENGTHS)), np.tile(LENGTHS, 2)
    zeros = np.zeros(len(length))
    points = {"set": np.zeros(len(length), np.int64), "sensor": sensor, "length": length,
              "capacitance": SLOPE * length + OFFSET, "residual": zeros, "loo_residual": zeros,
              "source_row": np.arange(2, 2 + len(length))}  # fmt: skip
    flat = np.zeros((1, 2))
    lines = {"name": np.array(["bench"]), "rms_set": np.zeros(1), "slope": flat + SLOPE, "slope_se": flat,
             "offset": flat + OFFSET, "rms": flat, "worst": flat, "loo_rms": flat,
             "quadratic_rms": np.full((1, 2), np.nan), "count": np.full((1, 2), len(LENGTHS)),
             "state": np.zeros((1, 2), np.uint8)}  # fmt: skip
    return {"points": Group(points), "lines": Group(lines, {"used": "bench"})}


def _history() -> dict[str, Group]:
    moved = 0.002
    slope = np.full((2, 2), SLOPE)
    offset = np.array([[OFFSET, OFFSET], [OFFSET - SLOPE * moved, OFFSET]])
    history = {"file": np.array(["a.json", "a.json"]), "commit": np.array(["", ""]),
               "time": np.array([1.7e9, 1.7e9 + 86400]), "slope": slope, "offset": offset,
               "state": np.zeros((2, 2), np.uint8),
               "range": np.tile([LENGTHS[0], LENGTHS[-1]], (2, 1)), "median_change": np.array([moved, np.nan]),
               "p90_change": np.array([moved, np.nan]), "median_rate": np.array([moved / 86400, np.nan])}  # fmt: skip
    drift = {"sensor": np.array([0, 1]), "before": np.zeros(2, np.int64), "after": np.ones(2, np.int64),
             "elapsed": np.full(2, 86400.0), "change": np.array([moved, 0.0]), "change_max": np.array([moved, 0.0]),
             "state": np.array([0, 1], np.uint8)}  # fmt: skip
    return {"history": Group(history, {"range_from": "points", "swap_threshold": 0.05}), "drift": Group(drift)}


def _force(x: np.ndarray, curve: int) -> np.ndarray:
    return K1[curve] * x + K2[curve] * x**2 + K3[curve] * x**3


def _tendons() -> dict[str, Group]:
    x, grid = np.linspace(0, 0.05, 6), np.linspace(0, 0.05, 5)
    points = {"curve": np.repeat([0, 1], len(x)), "displacement": np.tile(x, 2),
              "force": np.concatenate([_force(x, 0), _force(x, 1)])}  # fmt: skip
    fits = np.stack([_force(grid, 0), _force(grid, 1)])
    slopes = np.array([(K1[i] + 2 * K2[i] * grid + 3 * K3[i] * grid**2).min() for i in (0, 1)])
    tendons = {"name": np.array(["one", "two"]), "k1": K1, "k2": K2, "k3": K3, "rms": np.zeros(2),
               "x_max": np.full(2, 0.05), "stiffness_min": slopes, "monotone": slopes > 0, "x": grid,
               "mean": fits.mean(axis=0), "sd": fits.std(axis=0, ddof=1)}  # fmt: skip
    means = {"k1_mean": float(K1.mean()), "k2_mean": float(K2.mean()), "k3_mean": float(K3.mean()), "x_common": 0.05,
             "monotone": True}  # fmt: skip
    return {"tendon_points": Group(points), "tendons": Group(tendons, means)}


def _rod() -> dict[str, Group]:
    mass, offset = np.array([0.1, 0.05, 0.05]), np.array([0.0, -0.16, 0.16])
    parts = {"rod": np.zeros(3, np.int64), "name": np.array(["tube", "left", "right"]),
             "shape": np.array(["tube", "point", "point"]), "mass": mass, "offset": offset,
             "radius": np.array([0.01, 0, 0]), "length": np.array([0.3, 0, 0]),
             "inner_radius": np.array([0.008, 0, 0])}  # fmt: skip
    axial = 0.1 * (0.01**2 + 0.008**2) / 2
    across = 0.1 * (3 * (0.01**2 + 0.008**2) + 0.3**2) / 12 + (mass * offset**2).sum()
    masses = {"rod": np.zeros(1, np.int64), "mass": np.array([0.2]), "com": np.zeros(1),
              "inertia_axial": np.array([axial]), "inertia_transverse": np.array([across])}  # fmt: skip
    return {"mass_parts": Group(parts), "masses": Group(masses)}
