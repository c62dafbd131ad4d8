"""Identified parameters."""

from __future__ import annotations

import numpy as np

from r2s2r_cli.checks.subjects import Content
from tests.checks.case import Case, Edge
from tests.support.check_subjects import edited_content, identification, put


def _edited(path: str, place: object, value: object) -> Content:
    return edited_content(identification(), path, put(place, value))


def _fewer(content: Content) -> Content:
    return edited_content(content, "starts/first", content.data.groups["starts"]["first"][:, :3])


FAILS: tuple[Case, ...] = (
    Case(
        "identification_tables_fit",
        lambda: _edited("profiles/parameter", 0, 4),
        (("profiles/parameter", "a row of profiles names a row of parameters that is not there", "0 .. 3",
          "4 at row 0"),),
    ),
    Case(
        "identification_tables_fit",
        lambda: _fewer(identification()),
        (("starts/first", "a table has another number of parameters", "4", "3"),),
    ),
    Case(
        "identification_rows_unique",
        lambda: _edited("parameters/name", 1, b"motor_speed"),
        (("parameters/name", "two parameters have the same name", "a name for each", "motor_speed"),),
    ),
    Case(
        "identification_rows_unique",
        lambda: _edited("segments/interval", 1, 1),
        (("segments/interval", "a target interval stands there twice", "once, with one role", "walk:1"),),
    ),
    Case(
        "identified_values_inside",
        lambda: _edited("parameters/bounds", (1, 1), 0.6),
        (("parameters/value", "friction lies outside its bounds", "0.05 .. 0.6", "0.62"),),
    ),
    Case(
        "identified_values_inside",
        lambda: _edited("parameters/lower", 0, 0.81),
        (("parameters/value", "motor_speed lies outside its 95 % interval", "0.81 .. 0.8196", "0.8"),),
    ),
    Case(
        "identified_deviations_honest",
        lambda: _edited("parameters/sd", 0, 0.0),
        (("parameters/sd", "an identifiable parameter has no standard deviation", "above 0", "0 of motor_speed"),),
    ),
    Case(
        "identified_deviations_honest",
        lambda: _edited("parameters/sd", 3, 0.001),
        (("parameters/sd", "a parameter that is not identifiable has a standard deviation", "NaN",
          "0.001 of restitution"),),
    ),
    Case(
        "identified_covariance_valid",
        lambda: _edited("covariance/covariance", (0, 1), 0.0),
        (("covariance/covariance", "the covariance is not symmetric", "equal to its transpose",
          "correlations that differ by 0.4"),),
    ),
    Case(
        "identified_covariance_valid",
        lambda: _edited("covariance/covariance", ([0, 1], [1, 0]), 0.001),
        (("covariance/covariance", "the covariance is negative in some direction", "eigenvalues of 0 or more",
          "-0.5512, of the correlations"),),
    ),
    Case(
        "identified_covariance_valid",
        lambda: _edited("covariance/correlation", (0, 1), 1.2),
        (("covariance/correlation", "a correlation is out of range", "-1 .. 1", "1.2 at row 0, column 1"),),
    ),
    Case(
        "identified_within_bounds",
        lambda: _edited("parameters/trust", 1, 3),
        (("parameters/trust", "friction ended on a bound", "inside", "on it"),),
    ),
    Case(
        "identification_predicts",
        lambda: _edited("measures/value", 1, 0.05),
        (("measures/value", "keyframe_cap_rmse of the test segments is worse than if nothing moved", "below 48 mm",
          "50 mm"),),
    ),
)  # fmt: skip

EDGES: tuple[Edge, ...] = (
    Edge("identified_values_inside", "on its bound", lambda: _edited("parameters/bounds", (1, 1), 0.62)),
    Edge("identified_values_inside", "no bound", lambda: _edited("parameters/bounds", 1, np.nan)),
    Edge("identification_predicts", "training segments", lambda: _edited("measures/value", 0, 1.0)),
    Edge("identification_predicts", "no free run", lambda: _edited("measures/value", 2, np.nan)),
)
