"""Which fits go on."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.stages.diagnose.which.hypothesis import Fit, Hypothesis
from r2s2r_cli.stages.diagnose.which.search import LEAST_SAID, SUSPECTED, _kept
from tests.support.linear_arena import candidate


def fit(name: str, cost: float) -> Fit:
    """Of one effect, of this cost."""
    nothing = np.zeros(0)
    return Fit(Hypothesis((candidate(name, 0),)), nothing, nothing, nothing, nothing, cost, nothing, nothing, [])


def test_of_what_parity_speaks_for_alike_the_better_fits_go_on() -> None:
    """Not those that a set of names happens to have first, which is another one in every process."""
    names = [f"effect_{k}" for k in np.random.default_rng(0).permutation(12)]
    fits = [fit(name, float(k)) for k, name in enumerate(names)]
    alike = {name: {None: LEAST_SAID} for name in names[4:]}
    assert _kept(fits, alike, 2) == [*fits[:2], *fits[4 : 4 + SUSPECTED]]


def test_what_parity_says_most_of_goes_on_and_what_it_hardly_says_does_not() -> None:
    """Beside the first fits; the best fit of an effect that has several."""
    fits = [fit(name, float(k)) for k, name in enumerate(("a", "b", "c", "d", "d", "e"))]
    said = {"c": {None: 0.9 * LEAST_SAID}, "d": {None: 0.0, 1: 2.0 * LEAST_SAID}, "e": {None: LEAST_SAID}}
    assert _kept(fits, said, 1) == [fits[0], fits[3], fits[5]]
    assert _kept(fits, {}, 2) == fits[:2]
