"""Two effects at once: a partner is judged by what the first effect leaves, not by what it would explain alone."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.which.pairs import SAID_MOST, partners

ROWS = 40


def response(effect: str, direction: np.ndarray, seen: float = 100.0, number: int | None = None) -> SimpleNamespace:
    """Of the screening, of unit length."""
    own = direction / np.linalg.norm(direction)
    candidate = SimpleNamespace(effect=effect, number=number)
    return SimpleNamespace(candidate=candidate, direction=own, seen=seen, absorbed=0.0, testable=seen >= 1.0)


@pytest.fixture
def axes() -> np.ndarray:
    """Orthogonal directions, (direction, row)."""
    return np.linalg.qr(np.random.default_rng(1).standard_normal((ROWS, ROWS)))[0].T


def found(first: SimpleNamespace, responses: list[SimpleNamespace], said: dict | None = None) -> list[str]:
    """Names of partners, best first."""
    fits = SimpleNamespace(likely=lambda fit: np.ones(ROWS))
    order = partners(fits, first, responses, said or {})  # type: ignore[arg-type]
    return [one.candidate.effect for one in order]


def fit(axes: np.ndarray, residual: np.ndarray) -> SimpleNamespace:
    """Of an effect along the first direction."""
    return SimpleNamespace(jacobian=axes[:1].T, residual=residual, hypothesis=SimpleNamespace(effects=("payload",)))


def test_a_look_alike_of_the_first_explains_nothing_beside_it(axes: np.ndarray) -> None:
    """Alone it would explain more than anything else; what the first leaves lies elsewhere."""
    left = 50.0 * axes[0] + 6.0 * axes[1] + 2.0 * axes[2]
    like = response("com_offset", axes[0] + 0.1 * axes[3])
    others = [like, response("backlash", axes[2]), response("motor_lag", axes[1]), response("payload", axes[1])]
    assert found(fit(axes, left), others) == ["motor_lag", "backlash", "com_offset"]


def test_of_every_effect_the_best_element_and_none_that_cannot_be_seen(axes: np.ndarray) -> None:
    """One response an effect, and only testable ones."""
    left = 5.0 * axes[1] + 9.0 * axes[2]
    responses = [response("cap_friction", axes[1], number=0), response("cap_friction", axes[2], number=3),
                 response("backlash", axes[2], seen=0.5)]  # fmt: skip
    fits = SimpleNamespace(likely=lambda fit: np.ones(ROWS))
    (one,) = partners(fits, fit(axes, left), responses, {})  # type: ignore[arg-type]
    assert one.candidate.number == 3


def test_the_parity_stage_speaks_for_partners_up_to_a_bound(axes: np.ndarray) -> None:
    """So that a replay that says far more is not outvoted."""
    said = {"backlash": {None: 60.0}}
    small, large = ((2.0 * SAID_MOST) ** 0.5 * factor for factor in (0.9, 1.1))
    both = [response("backlash", axes[5]), response("motor_lag", axes[1])]
    assert found(fit(axes, small * axes[1]), both, said)[0] == "backlash"
    assert found(fit(axes, large * axes[1]), both, said)[0] == "motor_lag"


def test_a_size_far_beyond_what_was_tried_counts_less(axes: np.ndarray) -> None:
    """What hardly shows at its usual size would have to be many times that."""
    left = 6.0 * axes[1] + 6.0 * axes[2]
    assert found(fit(axes, left), [response("air_drag", axes[1], seen=1.5), response("motor_lag", axes[2])])[0] == (
        "motor_lag"
    )
