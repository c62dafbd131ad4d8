"""Which sets belong to which bank."""

import itertools

import numpy as np
import pytest

from r2s2r_cli.blind.split import FAINT, LOUD_M, NOISE_M, RANGES, SHARES, Bank, Kind, kinds, seeds, size
from r2s2r_cli.errors import UsageError


def test_no_seed_is_in_two_banks() -> None:
    """Neither by its range nor by the rig's own seeds, which are 64 to a set."""
    for a, b in itertools.combinations(RANGES.values(), 2):
        assert a.seeds.stop <= b.seeds.start or b.seeds.stop <= a.seeds.start


@pytest.mark.parametrize("noise_m", NOISE_M)
def test_sizes_of_the_banks_differ_and_lie_in_their_ranges(noise_m: float) -> None:
    """A threshold fitted to the sizes of one bank is not one for the other; and under much noise none is drawn that
    lies below half the floor, but for the faint ones."""
    rng = np.random.default_rng(0)
    drawn = {bank: np.array([size(bank, rng, noise_m) for _ in range(4000)]) for bank in Bank}
    for bank, values in drawn.items():
        of = RANGES[bank]
        faint = of.faint or (np.inf, -np.inf)
        low = of.loud if noise_m >= LOUD_M else of.low
        plain = (values >= low) & (values <= of.high)
        assert (plain | ((values >= faint[0]) & (values <= faint[1]))).all()
        assert of.faint is None or np.mean(~plain) == pytest.approx(FAINT, abs=0.04)
    assert drawn[Bank.BLIND].max() > RANGES[Bank.CALIBRATION].high
    assert drawn[Bank.BLIND].min() < drawn[Bank.CALIBRATION].min()


@pytest.mark.parametrize(("count", "wanted"), [(20, (3, 12, 2, 3)), (120, (18, 72, 12, 18)), (250, (38, 150, 25, 37))])
def test_shares_of_the_kinds_are_those_asked_for(count: int, wanted: tuple[int, ...]) -> None:
    """15 per cent none, 60 single, 10 pairs, 15 outside, to the whole set."""
    found = kinds(count, np.random.default_rng(1))
    got = [found.count(kind) for kind in Kind]
    assert sum(got) == count and max(abs(a - b) for a, b in zip(got, wanted, strict=True)) <= 1
    assert sum(SHARES.values()) == pytest.approx(1.0)


def test_a_bank_that_is_too_small_is_refused() -> None:
    """More sets than seeds would reach into another bank."""
    with pytest.raises(UsageError, match="no such sets"):
        seeds(Bank.REGRESSION, 1001)
    assert list(seeds(Bank.REGRESSION, 3, 5)) == [1005, 1006, 1007]
