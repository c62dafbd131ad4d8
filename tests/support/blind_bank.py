"""A bank of 250 labels with the composition of the trials, and reference diagnosers that answer it without looking."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from r2s2r_cli.blind.score.facts import Said, Truth, said_of, truth_of
from r2s2r_cli.blind.split import GAITS, NOISE_M, RATES_HZ, Kind, kinds

EFFECTS = {
    "payload": ("mass", {"kind": "rod", "index": 1, "xy_m": None}),
    "friction_field": ("contact", {"kind": "place", "xy_m": [0.1, 0.0]}),
    "motor_lag": ("motor", None),
    "sensor_bias": ("sensing", {"kind": "sensor", "index": 4}),
    "cap_friction": ("contact", {"kind": "cap", "index": 2}),
    "camera_delay": ("observation", None),
    "ground_slope": ("world", None),
    "backlash": ("cable", None),
}
Answer = Callable[[dict[str, Any], np.random.Generator], dict[str, Any]]


def bank(count: int = 250, seed: int = 0) -> list[dict[str, Any]]:
    """Labels as the maker writes them, of worlds that were never simulated."""
    rng = np.random.default_rng(seed)
    # Of its own, so that what was recorded does not change what is wrong.
    seen = np.random.default_rng([seed, 1])
    found = []
    for number_of_set, kind in enumerate(kinds(count, rng)):
        number = {Kind.NONE: 0, Kind.SINGLE: 1, Kind.PAIR: 2, Kind.OUTSIDE: 0}[kind]
        ids = [str(one) for one in rng.choice(list(EFFECTS), number, replace=False)]
        d = float(np.exp(rng.uniform(np.log(1.0), np.log(30.0))))
        onset = {"gait": "g1", "interval": 3, "of_set": 3}
        effects = [
            {"id": one, "channel": EFFECTS[one][0], "element": EFFECTS[one][1],
             "onset": onset if one == "friction_field" else None} for one in ids
        ]  # fmt: skip
        found.append({
            "kind": kind.value, "effects": effects, "d": None if kind is Kind.NONE else d, "d_each": [d] * number,
            "outside": {"name": "floor_bump", "channel": "contact"} if kind is Kind.OUTSIDE else None,
            "noise_m": float(seen.choice(NOISE_M)), "gaits": int(seen.choice(GAITS)),
            "rate_hz": float(seen.choice(RATES_HZ)), "seed": 1000 * seed + number_of_set, "observed": 0,
        })  # fmt: skip
    return found


def answered(labels: list[dict[str, Any]], answer: Answer, seed: int = 1) -> list[tuple[str, Truth, Said]]:
    """Truths and verdicts of one diagnoser."""
    rng = np.random.default_rng(seed)
    return [(f"{i:03d}", truth_of(label), said_of({"diagnosis": answer(label, rng)})) for i, label in enumerate(labels)]


def always(label: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """friction_field, whatever was seen."""
    return document("effect", ["friction_field"], {"friction_field": 0.9, "payload": 0.05, "none": 0.05})


def by_chance(label: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Any answer, as sure of it as chance will have it."""
    names = [*EFFECTS, "none", "unknown"]
    p = rng.dirichlet(np.full(len(names), 0.5))
    first = names[int(p.argmax())]
    verdict = {"none": "no_gap", "unknown": "unknown"}.get(first, "effect")
    return document(verdict, [first] if verdict == "effect" else [], dict(zip(names, p.tolist(), strict=True)))


def right(label: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """The truth, as if it had been told; sure of it in 19 of 20."""
    truth = truth_of(label)
    ids = [one["id"] for one in label["effects"]]
    if truth.right is None:
        return document("pair", ids, dict.fromkeys(ids, 0.48) | {"none": 0.04})
    verdict = {"none": "no_gap", "unknown": "unknown"}.get(truth.right, "effect")
    found = document(verdict, [truth.right] if verdict == "effect" else [], {truth.right: 0.97, "other": 0.03})
    found["where"] = {"channel": truth.channel, "element": label["effects"][0]["element"] if ids else None,
                      "onset_segment": truth.onset["of_set"] if truth.onset else None}  # fmt: skip
    if rng.random() < 0.1:
        found["set90"] = ["other"]
    return found


def document(verdict: str, effects: list[str], probability: dict[str, float]) -> dict[str, Any]:
    """What `diagnose --json` says, as far as it is scored."""
    order = sorted(probability, key=lambda name: -probability[name])
    return {
        "verdict": verdict, "effects": effects, "probability": probability[order[0]], "set90": order[:2],
        "ranking": [{"effect": name, "elpd_gain": 0.0, "probability": probability[name], "parity_nats": 2.0 * rank}
                    for rank, name in enumerate(order)],
        "where": {"channel": "contact", "element": {"kind": "place", "index": None, "xy_m": [0.1, 0.3]}},
        "shrinkage": {"own_share": 0.7, "predicted": 0.65}, "chance_nats": 2.0, "floor_m": 0.01, "refit_upper_m": 0.02,
        "calibrated": "by hand",
    }  # fmt: skip
