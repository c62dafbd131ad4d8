"""Camera against sensors and robot.toml: planted biases, gains, shifts and scales are recovered within their errors.

Logs are formulas (tests/support/parity_log.py): no simulator has a part in them.
"""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.diagnose.parity import Finding, Parity, parity
from r2s2r_cli.stages.diagnose.parity.lengths import sensor_parity
from r2s2r_cli.stages.diagnose.parity.series import series
from tests.support.engine import threebar
from tests.support.parity_log import Faults, evidence_of, foremost, swaying


def _parity(faults: Faults | None) -> Parity:
    return parity(evidence_of(
        tuple(swaying(f"g{k}", k, faults) for k in range(2)), (swaying("c", 10),)
    ))  # fmt: skip


def _one(found: Parity, check: str, index: int | None) -> Finding:
    return next(one for one in found.of(check) if one.element.index == index)


def test_a_planted_bias_is_measured_and_leads_to_its_effect() -> None:
    """8 mm on sensor 3: found to 1 mm, significant, first, with a start value; the other sensors are not suspected."""
    bias = np.zeros(9)
    bias[3] = 0.008
    found = _parity(Faults(bias=bias))
    one = _one(found, "sensor_bias", 3)
    assert abs(one.value - 0.008) < min(4 * one.sd, 1e-3)
    assert found.findings[0] is one
    assert found.differential
    assert foremost(found) == ("sensor_bias", 3)
    assert abs(found.starts()["sensor_bias"]["bias_m.3"] - 0.008) < 1e-3
    assert [f.element.index for f in found.significant if f.check == "sensor_bias"] == [3]


def test_a_planted_gain_is_measured() -> None:
    """A sensor that shows 20 per cent too much: found within four errors, its own element, no other check above it."""
    gain = np.ones(9)
    gain[5] = 1.2
    found = _parity(Faults(gain=gain))
    one = _one(found, "sensor_gain", 5)
    assert abs(one.value - 0.2) < min(4 * one.sd, 0.03)
    assert found.findings[0] is one


def test_late_stamps_are_measured_to_a_tenth_of_a_frame() -> None:
    """A camera that is 80 ms early."""
    found = _parity(Faults(late=-0.08))
    one = _one(found, "camera_delay", None)
    assert abs(one.value + 0.08) < 0.004
    assert found.findings[0] is one
    assert one in found.significant
    assert foremost(found) == ("camera_delay", None)
    assert abs(found.starts()["camera_delay"]["tau_s"] + 0.08) < 0.004


def test_a_scale_is_not_taken_for_nine_wrong_sensors() -> None:
    """A camera that shows everything 3 per cent too large: the rods say so, and sensors are compared without it."""
    found = _parity(Faults(scale=1.03))
    one = _one(found, "camera_scale", None)
    assert abs(one.value - 1.03) < min(4 * one.sd, 0.002)
    assert found.findings[0] is one
    assert not [f for f in found.significant if f.check in ("sensor_bias", "sensor_gain")]


def test_errors_cover_the_truth() -> None:
    """Of 9 biases in 12 logs (108 numbers) at least 90 per cent lie within two of their errors, and not all by far."""
    inside, z = 0, []
    for seed in range(12):
        bias = 0.004 * np.random.default_rng([seed, 5]).standard_normal(9)
        own = sensor_parity([series(swaying("g", seed, Faults(bias=bias)), threebar())])
        assert own is not None
        z += [(one.value - b) / one.sd for one, b in zip(own.bias, bias, strict=True)]
        inside += sum(abs(one.value - b) < 2 * one.sd for one, b in zip(own.bias, bias, strict=True))
    assert inside >= 0.9 * 108
    assert np.std(z) > 0.3
