"""The real crawl, diagnosed, and diagnosed again under tracker noise that is drawn anew.

Run `python examples/15_crawl_again/run.py --out DIR --draws 10`; run again it goes on where it was. A verdict that
another draw of the noise would change is worth nothing. What came out: README.md beside this file.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np

REAL = Path(os.environ.get("R2S2R_REAL_DIR", Path(__file__).resolve().parents[3] / "shared" / "real"))
COMMAND = (sys.executable, "-m", "r2s2r_cli")
SPLIT = ("--train", "crawl:1-7", "--test", "crawl:8-11")
# One fit: the range over starts and the profiles, which take minutes, say nothing to a diagnosis.
QUICK = ("--starts", "1", "--set", "identify.profiles=0", "--no-draw")


def r2s2r(project: Path, *words: str) -> str:
    """What a command that must succeed prints."""
    print("$ r2s2r", *words, file=sys.stderr, flush=True)
    done = subprocess.run([*COMMAND, *words, "--quiet"], cwd=project, check=True, stdout=subprocess.PIPE, text=True)
    return done.stdout


def diagnosed(project: Path, source: Path, model: Path | None = None) -> dict[str, Any]:
    """The report of `diagnose` on a crawl, made where it is not there. model: the identification to start from; None:
    this project's own."""
    kept = project / "report.json"
    if not kept.exists():
        if not (project / "project.toml").exists():
            project.parent.mkdir(parents=True, exist_ok=True)
            r2s2r(project.parent, "init", project.name)
        r2s2r(project, "import", str(source), "--no-draw")
        r2s2r(project, "estimate", "--no-draw")
        words = ("--no-draw",) if model else ()
        if model is None:
            r2s2r(project, "identify", *SPLIT, *QUICK)
        else:
            words += ("--model", str(model))
        kept.write_text(r2s2r(project, "diagnose", *SPLIT, *words, "--json"), "utf-8")
    report: dict[str, Any] = json.loads(kept.read_text("utf-8"))["report"]
    return report


def redrawn(source: Path, estimate: Path, to: Path, seed: int) -> None:
    """The crawl as the tracker might have seen it another time: the smoothed motion with white noise of the sd that the
    estimate ascribes to every coordinate, rods made rigid again, as that tracker does."""
    rng = np.random.default_rng(seed)
    with source.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    t = np.array([float(row["t_s"]) for row in rows])
    with h5py.File(estimate) as file:
        run = file["runs/crawl"]
        smooth, times, sd = run["frames/p_WE"][()], run["frames/t"][()], run["tracks/noise_sd"][()]
    caps = np.stack([np.interp(t - t[0], times, column) for column in smooth.reshape(len(times), -1).T], axis=-1)
    seen = caps.reshape(-1, 6, 3) + np.nan_to_num(sd) * rng.standard_normal((len(t), 6, 3))
    ends = seen.reshape(-1, 3, 2, 3)
    way = ends[:, :, 1] - ends[:, :, 0]
    length = np.linalg.norm(smooth[0].reshape(3, 2, 3)[:, 1] - smooth[0].reshape(3, 2, 3)[:, 0], axis=-1)
    half = 0.5 * length[:, None] * way / np.linalg.norm(way, axis=-1, keepdims=True)
    middle = ends.mean(axis=2)
    seen = np.stack([middle - half, middle + half], axis=2).reshape(-1, 6, 3)
    for row, frame in zip(rows, seen, strict=True):
        for cap, place in enumerate(frame):
            row.update({f"cap{cap}_{axis}_m": f"{x:.6f}" for axis, x in zip("xyz", place, strict=True)})
    with to.open("w", encoding="utf-8", newline="") as out:
        writer = csv.DictWriter(out, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    sidecar = source.with_suffix(".toml").read_text("utf-8")
    again = sidecar.replace('source = "', f'source = "noise drawn anew with seed {seed}; ')
    to.with_suffix(".toml").write_text(again, "utf-8")


def line(name: str, report: dict[str, Any]) -> str:
    """One row of the table."""
    first = ", ".join(f"{one['effect']} {one['probability']:.2f}" for one in report["ranking"][:3])
    return f"| {name} | {said(report)} | {first} |"


def said(report: dict[str, Any]) -> str:
    """The verdict with the effects that it names."""
    return " ".join([report["verdict"], " + ".join(report["effects"])]).strip()


def main() -> None:
    """The crawl, then its draws."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder of the projects")
    parser.add_argument("--draws", type=int, default=10, help="of the tracker's noise")
    asked = parser.parse_args()
    crawl = REAL / "tribar_crawl" / "crawl.csv"
    if not crawl.exists():
        sys.exit(f"the real crawl is not at {crawl}: set R2S2R_REAL_DIR to the folder of the real measurements")
    out = asked.out.resolve()
    first = out / "measured"
    own = first / "iterations" / "001"
    measured = diagnosed(first, crawl)
    print(line("as measured", measured), flush=True)
    same = 0
    for seed in range(1, asked.draws + 1):
        folder = out / f"draw-{seed}"
        source = folder / "crawl.csv"
        folder.mkdir(parents=True, exist_ok=True)
        if not source.exists():
            redrawn(crawl, own / "20-estimate.h5", source, seed)
        report = diagnosed(folder / "project", source, own / "30-identify.h5")
        same += report["verdict"] == "ambiguous" or said(report) == said(measured)
        print(line(f"draw {seed}", report), flush=True)
    print(f"\nthe same verdict, or `ambiguous`, in {same} of {asked.draws} draws")


if __name__ == "__main__":
    main()
