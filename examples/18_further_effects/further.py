"""The effects beyond the catalogue, planted in the MuJoCo rig with laws of its own, and looked for when they are named.

    python further.py make SETS   # the rig: two worlds an effect, two healthy ones; what is wrong goes into SETS/truth
    python further.py look SETS   # the diagnosis: a verdict on every set, SETS/verdicts; it does not open the truth
    python further.py tell SETS   # both side by side

What is there already is not done again. `--part K/N` does every Nth set only: N processes side by side.
"""

from __future__ import annotations

import argparse
import json
import shutil
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

FURTHER: dict[str, tuple[str, dict[str, Any]]] = {
    "tendon_hysteresis": ("cable", {"force_n": 0.8}),
    "capstan_friction": ("cable", {"wrap": 0.3}),
    "attachment_offset": ("cable", {"moved": [{"cable": 6, "end": 0, "by_m": [0.0, 0.0, 0.02]}]}),
    "friction_anisotropy": ("contact", {"angle_rad": 0.6, "across": 0.6, "against": 0.1}),
    "stribeck": ("contact", {"static_factor": 1.8, "speed_m_per_s": 0.05}),
    "viscous_contact": ("contact", {"drag_n_s_per_m": 2.0}),
    "obstacle": ("contact", {"from_m": [0.12, -0.8], "to_m": [0.12, 0.8], "height_m": 0.008}),
    "air_drag": ("world", {"density_kg_per_m3": 60.0}),
    "sensor_saturation": ("sensing", {"above_m": 0.17}),
}
"""By id the channel, and the table of the rig's world file: chosen before anything was diagnosed."""
SEEDS = (7_100_000, 7_200_000)
"""Of the worlds, beside the effect's place: of no bank of the blind trials."""
GAITS, NOISE_M = 5, 0.002


def names() -> list[str]:
    """Of all sets."""
    return [f"{name}-{k + 1}" for name in (*FURTHER, "none") for k in range(len(SEEDS))]


def make(sets: Path, part: list[str]) -> None:
    """Drive the rig, write its logs, and what is wrong beside them."""
    from r2s2r_cli.blind.make.effects import Planted
    from r2s2r_cli.blind.make.one import make_set
    from r2s2r_cli.blind.make.worlds import hidden
    from r2s2r_cli.blind.split import Bank, Kind

    for name in part:
        effect, _, k = name.rpartition("-")
        truth = sets / "truth" / f"{name}.json"
        if truth.exists():
            continue
        seed = SEEDS[int(k) - 1] + [*FURTHER, "none"].index(effect)
        world = hidden(Bank.REGRESSION, seed, Kind.NONE, gaits=GAITS, noise_m=NOISE_M)
        if effect != "none":
            channel, table = FURTHER[effect]
            world = replace(world, planted=(Planted(effect, table, channel, {}),), factor=1.0)
        shutil.rmtree(sets / "sets" / name, ignore_errors=True)
        label = make_set(world, sets / "sets" / name)
        truth.parent.mkdir(parents=True, exist_ok=True)
        truth.write_text(json.dumps(label, indent=1) + "\n", encoding="utf-8")
        said = "healthy" if label["d"] is None else f"d = {label['d']:.1f}, {label['gap_mm']:.1f} mm at key frames"
        print(f"{name}: {said}", flush=True)


def look(sets: Path, part: list[str]) -> None:
    """Diagnose every set with the catalogue and all that is beyond it."""
    from r2s2r_cli.blind.catalogue import diagnosed
    from r2s2r_cli.blind.sets import read_set
    from r2s2r_cli.effects import known_effects
    from r2s2r_cli.errors import R2S2RError

    asked = tuple(effect.name for effect in known_effects())
    for name in part:
        out = sets / "verdicts" / f"{name}.json"
        if out.exists() or not (sets / "sets" / name).is_dir():
            continue
        begun = time.monotonic()
        settings = {"effects": asked, "cache": str(sets / "cache"), "threads": 1}
        try:
            found = diagnosed(read_set(sets / "sets" / name), settings)
        except R2S2RError as error:  # data that are refused have no verdict, which is a miss
            found = {"verdict": "refused", "effects": [], "ranking": [], "sentence": error.what}
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        print(f"{name}: {found['sentence']} ({time.monotonic() - begun:.0f} s)", flush=True)


def tell(sets: Path, part: list[str]) -> None:
    """What was planted, what was said, and at which place of the ranking the planted one stands."""
    for name in part:
        files = [sets / folder / f"{name}.json" for folder in ("truth", "verdicts")]
        if not all(file.exists() for file in files):
            continue
        truth, found = (json.loads(file.read_text(encoding="utf-8")) for file in files)
        effect = name.rpartition("-")[0]
        ranks: list[dict[str, Any]] = found["ranking"]
        place = next((i + 1 for i, one in enumerate(ranks) if one["effect"] == effect), None)
        first = ", ".join(f"{one['effect']} {one['probability']:.2f}" for one in ranks[:3])
        d = "" if truth["d"] is None else f"{truth['d']:.1f}"
        print(f"{name:24s} d {d:5s} {found['verdict']:10s} {' + '.join(found['effects']):24s} at {place}: {first}")


def main() -> None:
    """One of the three."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("make", "look", "tell"))
    parser.add_argument("sets", type=Path)
    parser.add_argument("--part", default="1/1", metavar="K/N")
    asked = parser.parse_args()
    k, n = (int(word) for word in asked.part.split("/"))
    {"make": make, "look": look, "tell": tell}[asked.what](asked.sets, names()[k - 1 :: n])


if __name__ == "__main__":
    main()
