"""Settings that contradict the data are named plainly, stop the verdict, and are not seen where there are none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.evidence import Run
from r2s2r_cli.stages.diagnose.parity import parity
from r2s2r_cli.stages.diagnose.parity.mismatch import mismatches
from r2s2r_cli.stages.diagnose.sensor_noise import noise_of
from tests.support.engine import threebar
from tests.support.parity_log import SPEED, evidence_of, swaying, with_caps, wound


def _runs() -> tuple[Run, ...]:
    return tuple(swaying(f"g{k}", k) for k in range(2))


def _caps(order: list[int]) -> Callable[[Run], Run]:
    return lambda run: with_caps(run, observed=run.caps.observed[:, order], p_WE=run.caps.p_WE[:, order])


def _control(by: Callable[[np.ndarray], np.ndarray]) -> Callable[[Run], Run]:
    return lambda run: with_caps(run, control=by(run.caps.control))


def _sensors(by: Callable[[np.ndarray], np.ndarray]) -> Callable[[Run], Run]:
    def changed(run: Run) -> Run:
        assert run.lengths is not None
        return replace(run, lengths=replace(run.lengths, length=by(run.lengths.length)))

    return changed


CASES = {
    "caps 0 and 1 are exchanged": ("order", _caps([1, 0, 2, 3, 4, 5])),
    "caps 1 and 2 are exchanged": ("order", _caps([0, 2, 1, 3, 4, 5])),
    "caps 0, 1, 2 and 3 are exchanged": ("order", _caps([2, 3, 0, 1, 4, 5])),
    "motors 2 and 3 are exchanged": ("order", _control(lambda u: u[:, [0, 1, 3, 2, 4, 5]])),
    "sensors 6 and 8 are exchanged": ("order", _sensors(lambda x: x[:, [0, 1, 2, 3, 4, 5, 8, 7, 6]])),
    "motor 4 winds the wrong way": ("sign", _control(lambda u: u * np.array([1, 1, 1, 1, -1, 1]))),
    "all motors wind the wrong way": ("sign", _control(lambda u: -u)),
    "in millimetres": ("unit", lambda run: with_caps(run, observed=1e3 * run.caps.observed, p_WE=1e3 * run.caps.p_WE)),
    "sensors read millimetres": ("unit", _sensors(lambda x: 1e3 * x)),
    "go up to 100": ("gain", _control(lambda u: 100 * u / np.abs(u).max())),
}


@pytest.mark.parametrize("words", CASES)
def test_each_mismatch_is_named(words: str) -> None:
    """Exchanged caps, motors and sensors, wrong signs, units and gains: named, and no physics beside them."""
    kind, change = CASES[words]
    found = parity(evidence_of(tuple(change(run) for run in _runs())))
    assert [one.kind for one in found.mismatches] == [kind]
    assert words in found.mismatches[0].what
    assert found.mismatches[0].hint.startswith("r2s2r ")
    assert not found.findings


def test_a_wrong_speed_of_all_winches_is_a_setting() -> None:
    """robot.toml with motors twice as fast as they are."""
    runs = [wound(f"g{k}", k, lambda u, h: np.cumsum(SPEED * h * u, axis=0)) for k in range(2)]
    found, _ = mismatches(runs, threebar(), 2 * SPEED)
    assert [one.kind for one in found] == ["rate"]
    assert "0.5 times" in found[0].what
    assert mismatches(runs, threebar(), SPEED)[0] == []


def test_winches_that_were_right_have_no_wrong_number() -> None:
    """At half their speed today, at all of it in healthy runs: an effect (a battery, a dead zone) is for the diagnosis
    to name. Half of it in both is a wrong number; so is a sign that was right before, since plugs are exchanged."""

    def at(share: float) -> list[Run]:
        return [wound(f"g{k}", k, lambda u, h: np.cumsum(share * SPEED * h * u, axis=0)) for k in range(2)]

    def kinds(today: float, before: float) -> list[str]:
        return [one.kind for one in mismatches(at(today), threebar(), SPEED, at(before))[0]]

    assert kinds(0.5, 1.0) == []
    assert kinds(0.5, 0.5) == ["rate"]
    turned = [_control(lambda u: -u)(run) for run in at(1.0)]
    assert [one.kind for one in mismatches(turned, threebar(), SPEED, at(1.0))[0]] == ["sign"]


def test_nothing_wrong_names_nothing() -> None:
    """No setting is doubted where all are right, for six logs."""
    for seed in range(6):
        assert mismatches([swaying("g", 20 + seed)], threebar(), SPEED)[0] == []


def test_boards_that_take_turns_are_no_mismatch() -> None:
    """Rows of the log with the sensors of one board each, as wireless robots send them: rates, signs and noise come
    from the readings that are there, and wrong ones are seen as well."""

    def turns(run: Run) -> Run:
        assert run.lengths is not None
        board = np.arange(9) % 3
        row = np.arange(len(run.lengths.t))
        length = np.where(row[:, None] % 3 == board, run.lengths.length, np.nan)
        return replace(run, lengths=replace(run.lengths, length=length))

    def reeled(u: np.ndarray, h: float) -> np.ndarray:
        return np.asarray(np.cumsum(SPEED * h * u, axis=0))

    runs = [turns(wound(f"g{k}", k, reeled)) for k in range(2)]
    assert mismatches(runs, threebar(), SPEED) == ([], [])
    assert [one.kind for one in mismatches(runs, threebar(), 2 * SPEED)[0]] == ["rate"]
    assert [one.kind for one in mismatches([_control(lambda u: -u)(run) for run in runs], threebar(), SPEED)[0]] == [
        "sign"
    ]
    assert runs[0].lengths is not None
    assert noise_of(runs[0].lengths.length) == pytest.approx(np.r_[np.full(6, 5e-4), np.zeros(3)], rel=0.25)


def test_winches_that_stand_have_no_wrong_number() -> None:
    """Motors that do not start are for the diagnosis to name; winches at a third of their speed are a wrong number."""

    def at(share: float) -> list[str]:
        runs = [wound(f"g{k}", k, lambda u, h: np.cumsum(share * SPEED * h * u, axis=0)) for k in range(2)]
        return [one.kind for one in mismatches(runs, threebar(), SPEED)[0]]

    assert at(0.0) == []
    assert at(0.3) == ["rate"]


def test_a_single_motor_that_stands_is_named() -> None:
    """Its cable keeps its length whatever it is told; one that turns one way only, or slowly, is for the diagnosis."""

    def found(inwards: float, outwards: float) -> list[str]:
        def lengths(u: np.ndarray, h: float) -> np.ndarray:
            own = np.where(u > 0, inwards, outwards)
            return np.asarray(np.cumsum(SPEED * h * u * np.where(np.arange(6) == 3, own, 1.0), axis=0))

        return [one.what for one in mismatches([wound(f"g{k}", k, lengths) for k in range(2)], threebar(), SPEED)[0]]

    assert found(0.0, 0.0) == ["motor 3 does not turn at full command, either way"]
    assert found(1.0, 0.0) == found(0.2, 0.2) == found(1.0, 1.0) == []


def _turned(u: np.ndarray, h: float) -> np.ndarray:
    return np.asarray(np.cumsum(SPEED * h * u, axis=0))


def test_commands_of_another_run_are_named() -> None:
    """The log of one run with the commands of another: the winches turn, and no order, sign or delay makes them follow.
    Late by 0.3 s they still follow: that is for the diagnosis to name."""
    runs = [wound(f"g{k}", k, _turned) for k in range(2)]
    others = [wound(f"g{k}", 40 + k, _turned) for k in range(2)]
    swapped = [with_caps(a, control=np.roll(b.caps.control, 70, axis=0)) for a, b in zip(runs, others, strict=True)]
    (found,) = mismatches(swapped, threebar(), SPEED)[0]
    assert found.kind == "commands"
    assert "not when the commands say so" in found.what
    late = [with_caps(one, control=np.roll(one.caps.control, -15, axis=0)) for one in runs]
    assert mismatches(late, threebar(), SPEED)[0] == []
    deaf = [replace(one, lengths=None) for one in swapped]
    settings, missing = mismatches(deaf, threebar(), SPEED)
    assert not any(one.kind == "commands" for one in settings)
    assert any("commands belong to the motion" in one for one in missing)


def test_exchanged_commands_of_winches_that_stand_are_no_mismatch() -> None:
    """Nothing follows commands where no winch turns, whosever they are: a dead zone is for the diagnosis to name."""
    still = [wound(f"g{k}", k, lambda u, h: np.zeros_like(u)) for k in range(2)]
    assert mismatches(still, threebar(), SPEED)[0] == []
    swapped = [with_caps(one, control=np.roll(one.caps.control, 70, axis=0)) for one in still]
    assert mismatches(swapped, threebar(), SPEED)[0] == []


@pytest.mark.parametrize("noise_m", [1e-3, 2e-3, 4e-3])
@pytest.mark.parametrize(("share", "kinds"), [(0.0, []), (0.3, ["rate"]), (1.0, [])])
def test_noisy_sensors_are_no_mismatch(noise_m: float, share: float, kinds: list[str]) -> None:
    """Readings that scatter move as fast as a winch does over a tenth of a second, and follow no command: what stands
    still stands, slow winches are slow, and good ones good."""

    def noisy(run: Run) -> Run:
        assert run.lengths is not None
        rng = np.random.default_rng(7)
        length = run.lengths.length + noise_m * rng.standard_normal(run.lengths.length.shape)
        return replace(run, lengths=replace(run.lengths, length=length))

    runs = [noisy(wound(f"g{k}", k, lambda u, h: share * _turned(u, h))) for k in range(2)]
    assert [one.kind for one in mismatches(runs, threebar(), SPEED)[0]] == kinds


@pytest.mark.parametrize("standing", [(3,), (1, 3), (1, 3, 4)])
def test_motors_that_stand_are_not_taken_for_another_log(standing: tuple[int, ...]) -> None:
    """Up to half of the motors without a plug: the others follow their commands."""
    turns = 1.0 - np.isin(np.arange(6), standing)
    runs = [wound(f"g{k}", k, lambda u, h: _turned(u, h) * turns) for k in range(2)]
    found = mismatches(runs, threebar(), SPEED)[0]
    assert not any(one.kind == "commands" for one in found)
    if len(standing) < 3:
        assert [one.kind for one in found] == ["motor"]
