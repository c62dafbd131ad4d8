"""From two kinds of gains to a verdict: all data rank, left-out gaits doubt."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from r2s2r_cli.effects import CATALOGUE
from r2s2r_cli.stages.diagnose.parity.finding import Element
from r2s2r_cli.stages.diagnose.parity.stranger import Stranger
from r2s2r_cli.stages.diagnose.which import verdict as module
from r2s2r_cli.stages.diagnose.which.bounded import ENOUGH
from r2s2r_cli.stages.diagnose.which.calibration import Calibration
from r2s2r_cli.stages.diagnose.which.found import Which
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.left import Left
from r2s2r_cli.stages.diagnose.which.material import Material
from r2s2r_cli.stages.diagnose.which.rivals import NoGap
from r2s2r_cli.stages.diagnose.which.score import Score
from r2s2r_cli.stages.diagnose.which.screen import LEAST_RESPONSE, Response
from r2s2r_cli.stages.diagnose.which.verdict import concluded
from schemas.results_diagnose import LAWLESS
from tests.support.linear_arena import STRETCHES, LinearArena, candidate

BY = Calibration(temperature=7.5, held=0.25, none=30.0, commit=0.54, conformal=0.01, stranger=-2.0, wider=0.7,
                 unfit=4.4, unfit_share=0.75)  # fmt: skip


@pytest.fixture(autouse=True)
def _only_ranked(monkeypatch: pytest.MonkeyPatch) -> None:
    """What needs a simulator beside the ranking is left out."""
    monkeypatch.setattr(module, "confusable", lambda *_: ())
    monkeypatch.setattr(module, "_shifts", lambda *_: ())


def score(gain: float) -> Score:
    """The same gain in every stretch, `gain` in all [nats]."""
    each, one = np.full(STRETCHES, gain / STRETCHES), np.ones(STRETCHES)
    return Score(each, one, np.zeros((STRETCHES, 1, 3)), np.ones(3), np.zeros((3, 3)))


def said(
    by: Calibration, *, left_out: float = 20.0, left: float = 0.0, unexplained: float = 0.0, parity: float = 0.0,
    of_payload: float = 0.0, pair: tuple[float, float] | None = None, screened: tuple[Response, ...] = (),
    asked: tuple[str, ...] | None = ("payload", "motor_lag"), stranger: Stranger | None = None,
) -> Which:  # fmt: skip
    """Of a payload with 90 nats on all data and 20 left out, and a lag with 40 and 60. left_out: of the payload;
    parity: for the lag, of_payload: for the payload. pair: what both together gain left out, and on all data.
    screened: other effects, of those `asked` for. stranger: of the logs."""
    arena = LinearArena(1.0)
    zero = np.zeros((STRETCHES, 0))
    fits = [Fit(Hypothesis((candidate(name, k),)), np.zeros(2), np.ones(1), np.zeros(1), np.zeros((1, 3)), 0.0,
                np.zeros(1), zero, []) for k, name in enumerate(("payload", "motor_lag"))]  # fmt: skip
    scores, marginal, whole = [score(left_out), score(60.0)], [90.0, 40.0], [95.0, 40.0]
    if pair is not None:
        both = Hypothesis((candidate("payload", 0), candidate("motor_lag", 1)))
        fits.append(replace(fits[0], hypothesis=both, x=np.ones(2), start=np.zeros(2)))
        scores, marginal, whole = [*scores, score(pair[0])], [*marginal, pair[1]], [*whole, pair[1]]
    base = Fit(Hypothesis(), np.zeros(2), np.zeros(0), np.zeros(1), np.zeros((1, 2)), 0.0, np.zeros(0), zero, [])
    return concluded(Material(
        arena=arena, base=base, refit=score(0.0), fits=tuple(fits), scores=tuple(scores),  # type: ignore[arg-type]
        responses=screened, chance=5.0, no_gap=NoGap(0.02, 0.03, 0.01, 0.0), wider=1.0, left=Left(50.0, left, 1.0),
        unexplained=unexplained, groups=arena.gait, calibration=by, chronic=np.zeros(len(fits)),
        marginal=np.array(marginal), whole=np.array(whole), asked=asked,
        parity={"motor_lag": {None: parity}, "payload": {None: of_payload}}, stranger=stranger,
    ))  # fmt: skip


def test_all_data_rank() -> None:
    """The payload is named although gaits that were left out say more for the lag; both gains stand in the ranking."""
    found = said(BY)
    assert (found.verdict, found.effects) == ("effect", ("payload",))
    first = found.ranking[0]
    assert (first.effect, first.marginal) == ("payload", 90.0)
    p = {one.effect: one.probability for one in found.ranking}
    assert sum(p.values()) == pytest.approx(1.0)
    gain = {one.effect: one.gain for one in found.ranking}
    assert gain["payload"] < 30.0 < gain["motor_lag"]
    worth = {name: 0.75 * all_data + 0.25 * gain[name] for name, all_data in (("payload", 90.0), ("motor_lag", 40.0))}
    assert np.log(p["payload"] / p["motor_lag"]) == pytest.approx((worth["payload"] - worth["motor_lag"]) / 7.5)
    assert np.log(p["motor_lag"] / p["none"]) == pytest.approx((worth["motor_lag"] - 30.0) / 7.5)


def test_what_left_out_gaits_speak_against_is_first_and_no_verdict() -> None:
    """Unless the parity stage speaks for it."""
    found = said(BY, left_out=-20.0)
    assert (found.verdict, found.ranking[0].effect) == ("ambiguous", "payload") and found.probability > BY.commit
    assert any("nothing else speaks for it" in text for text in found.warnings)
    assert said(BY, left_out=-20.0, of_payload=BY.by_chance + 1.0).effects == ("payload",)


def test_without_healthy_runs_the_lesser_gain_counts() -> None:
    """So each counts what left-out gaits say, which is less than all data do; no piece says more than ENOUGH."""
    found = said(BY.absolute())
    assert (found.verdict, found.effects) == ("effect", ("motor_lag",))
    p = {one.effect: one.probability for one in found.ranking}
    gain = {one.effect: one.gain for one in found.ranking}
    assert gain["payload"] < 30.0 < gain["motor_lag"] < 40.0
    assert np.log(p["motor_lag"] / p["payload"]) == pytest.approx((gain["motor_lag"] - gain["payload"]) / 7.5)


def test_parity_speaks_beside_the_replay() -> None:
    """10 nats of it at 15 each outdo the 50 that the lag is short of."""
    assert said(BY, parity=10.0).effects == ("motor_lag",)


def test_what_the_logs_show_and_no_law_has_is_the_verdict() -> None:
    """However well a name explains the rest; where it sits, and by how much, goes on to the report."""
    strange = Stranger("sensing", Element("sensor"), 60.0, "off are sensors 0, 7 and 8")
    found = said(BY, stranger=strange)
    assert (found.verdict, found.effects, found.probability) == ("unknown", (), LAWLESS)
    assert found.ranking[0].effect == "unknown" and found.stranger is strange
    assert sum(one.probability for one in found.ranking) == pytest.approx(1.0)
    assert said(BY, stranger=strange, unexplained=-np.inf).ranking[0].effect == "payload"


def test_a_stranger_takes_its_share_of_all_names() -> None:
    """What a wider floor explains lowers every name alike until none is a verdict; what is left beyond all healthy
    runs makes `unknown` the verdict."""
    ambiguous = said(BY, unexplained=400.0)
    assert ambiguous.verdict == "ambiguous"
    p, before = ({one.effect: one.probability for one in found.ranking} for found in (ambiguous, said(BY)))
    assert p["payload"] / p["motor_lag"] == pytest.approx(before["payload"] / before["motor_lag"])
    assert p["unknown"] > 0.5 > before["unknown"]
    assert said(BY, left=4.5).verdict == "unknown" and said(BY, left=4.3).verdict == "effect"
    assert said(BY, left=4.5, unexplained=-np.inf).verdict == "effect"


def test_what_a_second_effect_adds_counts_beyond_six_nats_a_piece() -> None:
    """A lag beside a payload of 20 nats left out: of 12 nats more in each of the pieces more than half counts, and on
    all data everything. What single effects gain is what it is without the pair."""
    alone, beside = said(BY), said(BY, pair=(20.0 + 12.0 * STRETCHES, 195.0))
    (pair,) = beside.pairs
    payload = next(one for one in beside.ranking if one.effect == "payload")
    assert pair.effects == ("payload", "motor_lag")
    assert ENOUGH * STRETCHES < pair.added < 12.0 * STRETCHES
    assert pair.gain == pytest.approx(payload.gain + pair.added)
    assert pair.marginal == pytest.approx(90.0 + 100.0)
    gains = [{one.effect: (one.gain, one.marginal) for one in found.ranking} for found in (alone, beside)]
    assert gains[0] == gains[1]


def test_a_pair_that_breaks_off_adds_nothing() -> None:
    """Not a number would make every probability none."""
    (pair,) = said(BY, pair=(-np.inf, -np.inf)).pairs
    assert pair.added == -np.inf
    found = said(BY, pair=(-np.inf, -np.inf))
    assert sum(one.probability for one in found.ranking) == pytest.approx(1.0) and found.effects == ("payload",)


def test_an_effect_of_a_package_may_be_screened_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """It stands in the ranking with its channel, as those of the catalogue do, not fitted."""
    wind = SimpleNamespace(name="side_wind", channel="wrench")
    monkeypatch.setattr("r2s2r_cli.effects.known.known_effects", lambda: (*CATALOGUE, wind))
    one = np.ones(1)
    response = Response(candidate("side_wind", 0), -2.0, one, one, one, 2 * LEAST_RESPONSE, 0.0, one)
    ranked = {found.effect: found for found in said(BY, screened=(response,), asked=None).ranking}
    assert (ranked["side_wind"].channel, ranked["side_wind"].fitted) == ("wrench", False)
