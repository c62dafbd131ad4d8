"""A structure is a key: equal ones have one hash, in this process and, made anew, in another."""

from __future__ import annotations

import copy
from dataclasses import replace

from r2s2r_cli.effects.base import with_off_values
from r2s2r_cli.effects.motor_lag import MotorLag
from r2s2r_cli.engine import Structure
from r2s2r_cli.engine.hooks import effective
from tests.support.engine import threebar_engine

PLAIN = Structure(n_rods=2, cable_rods=((0, 1), (1, 0)), actuated=(0,))


def test_equal_structures_are_one_key() -> None:
    """Whether they were asked for their hash before or not; another field is another key."""
    assert hash(PLAIN) == hash(replace(PLAIN))
    own = {PLAIN: "plain", PLAIN.with_effects(MotorLag()): "late"}
    assert own[replace(PLAIN)] == "plain"
    assert own[PLAIN.with_effects(MotorLag())] == "late"
    assert replace(PLAIN, cubic=True) not in own


def test_a_copy_works_its_hash_out_itself() -> None:
    """A copy is what another process gets, where words have other hashes: that of here must not travel."""
    late = PLAIN.with_effects(MotorLag())
    known = hash(late)
    sent = copy.copy(late)
    assert "_hash" in vars(late) and "_hash" not in vars(sent)
    assert sent == late and hash(sent) == known


def test_own_parameters_of_an_effect_are_found_by_their_short_names() -> None:
    """Those of every effect, whatever the order in which they were put in; none for one that is not there."""
    structure, theta, _ = threebar_engine()
    structure = structure.with_effects(MotorLag())
    theta = with_off_values(structure, theta)
    assert theta.of("motor_lag").keys() == {"tau_s"}
    assert theta.of("motor_lag")["tau_s"] is theta.extra["motor_lag.tau_s"]
    assert theta.of("payload") == {}
    changed = theta.with_values({"motor_lag.tau_s": theta.extra["motor_lag.tau_s"] + 0.1})
    assert float((changed.of("motor_lag")["tau_s"] - theta.of("motor_lag")["tau_s"]).min()) > 0.09
    assert effective(structure, changed).lag.min() > effective(structure, theta).lag.max()
