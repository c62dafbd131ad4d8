"""The parity checks of an evidence: what is measured, compared with healthy runs or the nominal, and put in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from r2s2r_cli.stages.diagnose.evidence import Evidence
from r2s2r_cli.stages.diagnose.parity.expected import EXPECTED, Expected
from r2s2r_cli.stages.diagnose.parity.finding import Element, Finding, Parity
from r2s2r_cli.stages.diagnose.parity.fitted import fitted_runs
from r2s2r_cli.stages.diagnose.parity.mismatch import mismatches
from r2s2r_cli.stages.diagnose.parity.quantities import Key, Quantities, quantities
from r2s2r_cli.stages.diagnose.parity.series import Measured
from r2s2r_cli.stages.diagnose.parity.stranger import stranger
from r2s2r_cli.stages.diagnose.parity.suspects import suspicions
from r2s2r_cli.stages.diagnose.parity.winch_fit import LAWS

SCALED = 4.0
"""A camera scale this many errors off is taken out before sensors are compared with the camera; the gain of a sensor,
before its winch is timed."""
SOFT_NATS, SOFT_SHARE = 6.0, 0.15
"""Winch laws are look-alikes: one that explains the ramps so many nats worse, and this share of the best gain, is
suspected e times less."""


def parity(evidence: Evidence, *, level: float = 0.05) -> Parity:
    """Every finding of the fitted intervals' runs, strongest first. level: false discovery rate of `significant`.

    With healthy runs every quantity is compared with its value there, else with the nominal. Settings that contradict
    the data come first: with one, no quantity is measured. Raises nothing for data that are too few: `missing` says so.
    """
    robot = evidence.robot
    runs = fitted_runs(evidence)
    speed = float(evidence.model.theta.speed_in.mean())
    wrong, missing = mismatches(runs, robot, speed, evidence.healthy)
    if wrong:
        return Parity((), tuple(wrong), tuple(missing), bool(evidence.healthy), level)
    healthy = evidence.healthy or None
    base = None if healthy is None else quantities(healthy, robot, speed)
    lag = EXPECTED["lag"].nominal if base is None else base.lag
    first = quantities(runs, robot, speed, lag=lag)
    scale = _scale(first, base)
    if scale != 1.0:
        first = quantities(runs, robot, speed, lag=lag, scale=scale)
    first = _by_true_length(first, base, robot.actuated)
    missing += list(first.missing)
    if base is None:
        missing.append("healthy runs: findings are against robot.toml, so what it has wrong counts as well")
    else:
        missing += [f"in healthy runs, {what}" for what in base.missing]
    findings = [one for key, value in first.of.items() if (one := finding_of(key, value, base, first)) is not None]
    findings.sort(key=lambda one: -abs(one.z))
    strange = stranger(findings, first.about)
    return Parity(tuple(findings), (), tuple(missing), base is not None, level, first.knock, strange)


def _scale(found: Quantities, base: Quantities | None) -> float:
    """By how much the camera shows everything too large, 1 where that does not stand out."""
    key: Key = ("camera_scale", "camera", None)
    one = finding_of(key, found.of[key], base, found)
    return 1.0 if one is None or abs(one.z) < SCALED else one.value / one.expected


def _by_true_length(found: Quantities, base: Quantities | None, actuated: Sequence[int]) -> Quantities:
    """Winding rates, which are read off the sensors, without the gain of a sensor that stands out."""
    of = dict(found.of)
    for k, cable in enumerate(actuated):
        rate, gain = ("winch_rate", "motor", k), ("sensor_gain", "sensor", cable)
        if rate not in of or gain not in of:
            continue
        one = finding_of(gain, of[gain], base, found)
        if one is not None and abs(one.z) >= SCALED:
            by, sd = math.log1p(one.value) - math.log1p(one.expected), math.hypot(one.sd, one.expected_sd)
            of[rate] = Measured(of[rate].value - by, math.hypot(of[rate].sd, sd))
    return replace(found, of=of)


def finding_of(key: Key, value: Measured, base: Quantities | None, found: Quantities) -> Finding | None:
    """What a quantity (check, kind and index of the element) says beside its value in healthy runs, or beside the
    nominal; None where nothing was measured."""
    check, kind, index = key
    if not (math.isfinite(value.value) and math.isfinite(value.sd)):
        return None
    scale = EXPECTED[check]
    expected, differential = Measured(scale.nominal, scale.built), False
    if base is not None and check == "lag":
        expected, differential = Measured(base.lag, scale.changed), True
    elif base is not None and key in base.of and _usable(base.of[key], scale):
        expected, differential = _posterior(expected, base.of[key], scale.changed), True
    difference = value.value - expected.value
    error = math.sqrt(value.sd**2 + expected.sd**2)
    z = float(difference / error)
    element = Element(kind, index)
    suspected = suspicions(check, difference, index)
    if check in LAWS:
        best = max(found.gain.values(), default=0.0)
        soft = SOFT_NATS + SOFT_SHARE * best
        share = math.exp((found.gain.get(check, 0.0) - best) / soft)
        suspected = tuple(replace(one, share=one.share * share) for one in suspected)
        if check in ("latency", "lag", "play") and difference < 0:
            suspected = ()
    against = "in healthy runs" if differential else "as built"
    measured, usual = scale.number(value.value), scale.number(expected.value)
    what = f"{scale.words.format(element=element.words())} is {measured}, {usual} {against}"
    if check == "knock" and found.knock is not None:
        what += f"; at {found.knock.t:.2f} s of {found.knock.run} they move by {1e3 * found.knock.whole:.0f} mm"
    return Finding(
        check, element, float(value.value), float(value.sd), scale.unit, float(expected.value), float(expected.sd),
        differential, z, math.erfc(abs(z) / math.sqrt(2)), what, suspected,
    )  # fmt: skip


def _usable(healthy: Measured, scale: Expected) -> bool:
    """Whether healthy runs have measured the quantity."""
    known = math.isfinite(healthy.value) and math.isfinite(healthy.sd)
    return known and abs(healthy.value - scale.nominal) <= scale.most


def _posterior(built: Measured, healthy: Measured, changed: float) -> Measured:
    """What this robot shows when nothing is wrong: few healthy runs measure it worse than robot.toml says it."""
    a, b = built.sd**-2, max(healthy.sd, 1e-12) ** -2
    return Measured((a * built.value + b * healthy.value) / (a + b), math.hypot((a + b) ** -0.5, changed))
