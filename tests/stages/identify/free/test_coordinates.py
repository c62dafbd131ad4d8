"""Coordinates of free numbers: there and back, and their slopes."""

from __future__ import annotations

import numpy as np
import pytest

from r2s2r_cli.stages.identify.free import Coordinate, Free, catalogue, slopes_of, values_of
from tests.support.varied import varied

FREES = catalogue(varied())


def free(coordinate: Coordinate) -> Free:
    """A number in (0.2, 1.4) that starts at 0.5."""
    return Free("x", "1", 0.5, 0.2, 1.4, coordinate)


@pytest.mark.parametrize("coordinate", Coordinate)
def test_there_and_back(coordinate: Coordinate) -> None:
    """from_z undoes to_z over the whole range."""
    one = free(coordinate)
    for value in np.linspace(0.21, 1.39, 7):
        assert one.from_z(one.to_z(float(value))) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize("coordinate", Coordinate)
def test_slope_is_the_derivative(coordinate: Coordinate) -> None:
    """d value / d z by central differences; the error is of order h^2 and rounding."""
    one, h = free(coordinate), 1e-5
    for value in (0.25, 0.5, 1.3):
        z = one.to_z(value)
        quotient = (one.from_z(z + h) - one.from_z(z - h)) / (2 * h)
        assert one.slope(z) == pytest.approx(quotient, rel=1e-8)


def test_no_coordinate_leaves_the_range() -> None:
    """LOGIT stays inside wherever z goes; the bounds of the others are those of the value."""
    assert 0.2 < free(Coordinate.LOGIT).from_z(-30.0) < free(Coordinate.LOGIT).from_z(30.0) < 1.4
    for coordinate in (Coordinate.LINEAR, Coordinate.LOG):
        one = free(coordinate)
        assert [one.from_z(z) for z in one.bounds_z()] == pytest.approx([0.2, 1.4])


def test_all_coordinates_of_the_catalogue_at_once() -> None:
    """Every start has a coordinate that leads back to it, and a positive finite slope."""
    frees = tuple(FREES.values())
    z = np.array([one.to_z(one.start) for one in frees])
    assert values_of(frees, z) == pytest.approx(np.array([one.start for one in frees]), rel=1e-12, abs=1e-15)
    slopes = slopes_of(frees, z)
    assert np.isfinite(slopes).all()
    assert (slopes > 0).all()


def test_a_number_that_went_to_its_bound_comes_back() -> None:
    """However far a fit goes beyond what floats tell from a bound: the value is the bound, and has a coordinate."""
    one = free(Coordinate.LOGIT)
    for z, bound in ((-1e9, 0.2), (-800.0, 0.2), (800.0, 1.4), (1e9, 1.4)):
        assert one.from_z(z) == bound
        assert one.slope(z) == 0.0
        assert one.from_z(one.to_z(bound)) == bound
    none = Free("x", "1", 0.5, 0.0, 1.4, Coordinate.LOG)
    assert none.from_z(-1e9) == 0.0
    assert none.from_z(none.to_z(0.0)) == pytest.approx(0.0, abs=1e-300)
