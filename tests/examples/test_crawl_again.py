"""Tracker noise that is drawn anew: the same motion and commands, rigid rods, the sd that the estimate ascribes."""

from __future__ import annotations

import csv
from pathlib import Path

import h5py
import numpy as np
import pytest

from tests.examples.load import load

example = load("15_crawl_again", "run")

FRAMES, SD = 400, 0.003


def crawl(folder: Path) -> tuple[Path, Path, np.ndarray]:
    """A log of a robot that drifts, what the estimate made of it (every second frame), and where the caps were."""
    t = 0.05 * np.arange(FRAMES)
    one = np.array([[-0.16, 0, 0], [0.16, 0, 0], [0, -0.16, 0.1], [0, 0.16, 0.1], [0, 0, 0.02], [0, 0, 0.34]])
    caps = one + np.stack([0.01 * t, 0 * t, 0 * t], axis=1)[:, None]
    names = [f"cap{cap}_{axis}_m" for cap in range(6) for axis in "xyz"]
    with (folder / "crawl.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["t_s", *names, "target0", "control0"])
        for k in range(FRAMES):
            writer.writerow([2.0 + t[k], *caps[k].ravel(), 0.25, -1 + k % 3])
    (folder / "crawl.toml").write_text('robot = "threebar"\nsource = "a test"\n', "utf-8")
    with h5py.File(folder / "estimate.h5", "w") as file:
        file["runs/crawl/frames/p_WE"], file["runs/crawl/frames/t"] = caps[::2], t[::2]
        sd = np.full((6, 3), SD)
        sd[4] = 0.0
        file["runs/crawl/tracks/noise_sd"] = sd
    return folder / "crawl.csv", folder / "estimate.h5", caps


def read(path: Path) -> tuple[np.ndarray, list[tuple[str, str, str]]]:
    """Caps (frame, cap, 3), and what else stands there."""
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    caps = np.array([[[float(row[f"cap{c}_{a}_m"]) for a in "xyz"] for c in range(6)] for row in rows])
    return caps, [(row["t_s"], row["target0"], row["control0"]) for row in rows]


def test_only_the_noise_is_another_one(tmp_path: Path) -> None:
    """Times and commands stay, rods keep their length, errors have the sd of each coordinate and another seed's are
    others."""
    source, estimate, truth = crawl(tmp_path)
    found = []
    for seed in (1, 2):
        example.redrawn(source, estimate, tmp_path / f"{seed}.csv", seed)
        caps, rest = read(tmp_path / f"{seed}.csv")
        assert rest == read(source)[1]
        assert f'source = "noise drawn anew with seed {seed}; a test"' in (tmp_path / f"{seed}.toml").read_text("utf-8")
        assert np.linalg.norm(caps[:, 1::2] - caps[:, ::2], axis=-1) == pytest.approx(0.32, abs=2e-6)
        found.append(caps - truth)
    across = found[0][:-1, 2, 0]  # to the side of its rod: rigidity takes nothing off
    assert across.std() == pytest.approx(SD, rel=0.1) and abs(across.mean()) < 4 * SD / np.sqrt(FRAMES)
    assert abs(np.corrcoef(found[0][:-1, 2, 0], found[1][:-1, 2, 0])[0, 1]) < 0.2


def test_a_verdict_is_a_line() -> None:
    """With the effects it names, and the first three of the ranking."""
    ranking = [{"effect": name, "probability": p} for name, p in (("payload", 0.5), ("none", 0.3), ("backlash", 0.1))]
    report = {"verdict": "effect", "effects": ["payload"], "ranking": [*ranking, {"effect": "x", "probability": 0.0}]}
    assert example.line("draw 3", report) == "| draw 3 | effect payload | payload 0.50, none 0.30, backlash 0.10 |"
    assert example.said({"verdict": "ambiguous", "effects": []}) == "ambiguous"
