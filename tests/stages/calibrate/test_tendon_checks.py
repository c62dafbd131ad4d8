"""Curves that can be read and are probably wrong: an offset of the load cell, a stiffness of another unit."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from hypothesis import given, strategies as st

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate import calibrate
from r2s2r_cli.stages.calibrate.tendon_checks import zero_offset
from r2s2r_cli.stages.calibrate.tendons import Curve, force_of
from schemas.robot import Robot
from tests.stages.calibrate.conftest import cubic_text, source

X = np.linspace(0, 0.1, 21)
K = np.array([80.0, -300.0, 4000.0])


def softened(robot: Robot, stiffness: float) -> Robot:
    """The robot with passive cables of this stiffness."""
    cables = tuple(
        cable if cable.kind == "actuated" else cable.model_copy(update={"stiffness_n_per_m": stiffness})
        for cable in robot.cables
    )
    return robot.model_copy(update={"cables": cables})


@given(st.floats(0.3, 5.0), st.integers(0, 2**32 - 1))
def test_a_planted_offset_is_measured(offset: float, seed: int) -> None:
    """A cubic plus a constant plus noise: the constant comes back within five standard errors of the noise."""
    noise = 0.01 * np.random.default_rng(seed).standard_normal(len(X))
    assert zero_offset(Curve("a", X, force_of(K, X) + offset + noise)) == pytest.approx(offset, abs=0.05)


@given(st.integers(0, 2**32 - 1))
def test_noise_alone_is_no_offset(seed: int) -> None:
    """A zeroed load cell with noise of 1 % of the range, and one without noise, are not complained about."""
    noise = 0.1 * np.random.default_rng(seed).standard_normal(len(X))
    clean = Curve("a", X, force_of(K, X))
    assert zero_offset(clean) == 0.0
    assert abs(zero_offset(Curve("a", X, clean.force + noise))) < 0.6  # 4 standard errors are 0.3 N here


def test_few_points_and_flat_curves_say_nothing() -> None:
    """Five displacements cannot tell an offset from a bend; a flat force has no range."""
    few = np.linspace(0, 0.1, 5)
    assert zero_offset(Curve("a", few, 80 * few + 3)) == 0.0
    assert zero_offset(Curve("a", X, np.full(len(X), 3.0))) == 0.0


def test_a_curve_that_was_not_zeroed_is_warned_about(robot: Robot) -> None:
    """The warning names curve and offset; zeroed, there is none."""
    soft = softened(robot, 100.0)
    text = cubic_text(K[None])
    rows = text.splitlines()
    shifted = "\n".join([rows[0], *(f"{a},{b},{float(c) + 2.5}" for a, b, c in (row.split(",") for row in rows[1:]))])
    for table, warned in ((text, False), (shifted, True)):
        _, report = calibrate(robot=soft, tendons=[source(table, "t.csv")])
        assert any("tendon curve t0" in text and "is 2.5 N" in text for text in report.warnings) is warned


@pytest.mark.parametrize(("stated", "warned"), [(100.0, False), (20.0, False), (3000.0, True), (1.0, True)])
def test_a_stiffness_of_another_unit_is_warned_about(robot: Robot, stated: float, warned: bool) -> None:
    """Measured 90 N/m: a factor of ten from robot.toml on either side is a unit, less is a tendon."""
    _, report = calibrate(robot=softened(robot, stated), tendons=[source(cubic_text(K[None]), "t.csv")])
    assert any("is the displacement in the unit" in text for text in report.warnings) is warned


@pytest.mark.parametrize(("delimiter", "word"), [(";", "semicolons"), ("\t", "tabs"), ("|", "bars")])
def test_other_delimiters_are_named_and_the_hint_converts(
    robot: Robot, tmp_path_factory: pytest.TempPathFactory, delimiter: str, word: str
) -> None:
    """A tendon table as a spreadsheet writes it, decimal commas too: the pasted hint makes it readable."""
    import subprocess

    for decimal in (".", ","):
        path = tmp_path_factory.mktemp("tendons") / "t.csv"
        path.write_text(cubic_text(K[None]).replace(",", delimiter).replace(".", decimal))
        with pytest.raises(InputError, match=f"separated by {word}") as caught:
            calibrate(robot=robot, tendons=[source(path.read_text(), str(path))])
        subprocess.run(["sh", "-c", caught.value.hint], check=True)
        assert calibrate(robot=robot, tendons=[source(path.read_text(), str(path))])[1].tendons is not None


def test_the_robot_that_init_writes_is_no_measure_of_itself(robot_text: str) -> None:
    """The tendons of robot.toml, measured, are what it says."""
    robot = Robot.model_validate(tomllib.loads(robot_text))
    k = next(cable.stiffness_n_per_m for cable in robot.cables if cable.kind == "passive")
    _, report = calibrate(robot=robot, tendons=[source(cubic_text(np.array([[k, 0.0, 0.0]])), "t.csv")])
    assert not any("unit of its column" in text for text in report.warnings)
