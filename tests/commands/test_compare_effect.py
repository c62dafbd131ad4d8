"""`compare` of a simulator that was identified with an effect: what the effect says is in what it predicts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.commands.conftest import invoke
from tests.commands.test_compare import GAIT
from tests.support.simulated_log import SPEED, simulated_project

pytestmark = pytest.mark.slow


def test_a_simulator_with_an_effect_is_compared_with_it(tmp_path: Path) -> None:
    """robot.toml's motors are a fifth too slow; each winch's own factor, in no robot.toml, mends it: the factors are
    found (1.25, of the four winches that turn), and the gait lasts as long as it did and ends where it did. All on the
    run that was learned from, which is enough to see whether the effect is there."""
    simulated_project(tmp_path / "bot", GAIT, told=0.8 * SPEED)
    where = ("--project", str(tmp_path / "bot"), "--no-draw", "--json")
    still = [word for k in (2, 5) for word in ("--fix", f"motor_speed_mismatch.factor.{k}=1")]
    made = invoke("identify", "--train", "gait:1-3", "--free", "friction", "--with-effect", "motor_speed_mismatch",
                  *still, *where)  # fmt: skip
    assert made.exit_code == 0, made.stderr
    numbers = json.loads(made.stdout)["report"]["parameters"]
    for k in (0, 1, 3, 4):
        assert numbers[f"motor_speed_mismatch.factor.{k}"]["value"] == pytest.approx(1.25, abs=0.08)
    result = invoke("compare", *where)
    assert result.exit_code == 0, result.stderr
    initial, refined = json.loads(result.stdout)["report"]["runs"]
    assert refined["trained_on"] and not initial["trained_on"]
    assert initial["duration_s"]["sim"] > 1.2 * initial["duration_s"]["real"]
    assert refined["duration_s"]["sim"] == pytest.approx(refined["duration_s"]["real"], abs=0.15)
    for error in ("com_end_error_m", "keyframe_cap_rmse_m"):
        assert refined[error] < 0.6 * initial[error]
