"""Diagnosis as a library: an effect is planted in runs that the engine makes, and looked for.

Run `python examples/14_diagnose/run.py`: one motor is 30 % slower than robot.toml says. `--plant NAME=VALUE` plants
something else (names and units: `r2s2r effects ID`), `--effect ID` says what is looked for, `--whole-catalogue` looks
for everything. What is written: the page of the diagnosis and its pictures.
"""

from __future__ import annotations

import argparse
import tempfile
import tomllib
from pathlib import Path

from r2s2r_cli.stages.diagnose.evidence import Evidence
from r2s2r_cli.stages.diagnose.sample import planted
from r2s2r_cli.stages.diagnose.stage import diagnosed
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.views.diagnose import draw_diagnosis
from r2s2r_cli.views.diagnose_page import diagnose_page, element_words
from schemas.config import DiagnoseSettings
from schemas.results_diagnose import DiagnoseReport
from schemas.robot import Robot

PLANTED = ("motor_speed_mismatch.factor.3=0.7",)
LOOKED_FOR = ("motor_speed_mismatch", "payload", "tendon_stiffness")


def runs(plant: list[str], gaits: int, seed: int, cache: Path) -> Evidence:
    """Random gaits of the three-rod robot with an effect that its simulator lacks; the last one is judged."""
    robot = Robot.model_validate(tomllib.loads(robot_toml("threebar")))
    numbers = {name: float(value) for name, _, value in (word.partition("=") for word in plant)}
    return planted(robot, numbers, gaits=gaits, targets=4, seed=seed, cache_dir=cache)


def shown(report: DiagnoseReport) -> None:
    """The verdict, and what it was chosen from."""
    print(report.sentence)
    for one in report.ranking:
        size = ", ".join(
            f"{name} {value:.3g} ({one.ci90[name][0]:.3g} .. {one.ci90[name][1]:.3g})"
            for name, value in one.size.items()
        )
        print(f"  {one.effect:22s} p = {one.probability:.2f}  {element_words(one.element):10s} {size}")
    print(f"probabilities are {report.calibrated}")


def main() -> None:
    """Plant, look, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plant", action="append", metavar="NAME=VALUE", help=f"default: {PLANTED[0]}")
    parser.add_argument("--effect", action="append", metavar="ID", help=f"default: {', '.join(LOOKED_FOR)}")
    parser.add_argument("--whole-catalogue", action="store_true", help="look for every effect: some minutes")
    parser.add_argument("--gaits", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, help="folder of page and pictures; default: a new one")
    asked = parser.parse_args()
    out = asked.out or Path(tempfile.mkdtemp(prefix="r2s2r-diagnose-"))
    out.mkdir(parents=True, exist_ok=True)
    evidence = runs(asked.plant or list(PLANTED), asked.gaits, asked.seed, out / "cache")
    effects = None if asked.whole_catalogue else tuple(asked.effect or LOOKED_FOR)
    parts: list[str] = []

    def told(part: str, done: int, total: int) -> None:
        del done, total
        if part not in parts:
            parts.append(part)
            print(f"... {part}", flush=True)

    data, report = diagnosed(evidence, DiagnoseSettings(), effects=effects, cache_dir=out / "cache", progress=told)
    shown(report)
    pictures = []
    for name, title, png in draw_diagnosis(data, report):
        (out / f"{name}.png").write_bytes(png)
        pictures.append((title, png))
    (out / "diagnosis.html").write_bytes(diagnose_page(report, pictures))
    print(f"wrote {out / 'diagnosis.html'} and {len(pictures)} pictures")


if __name__ == "__main__":
    main()
