"""For every check: subjects that fail it with exactly this message, and subjects at the edge that still pass."""

from __future__ import annotations

from tests.checks.case import Case, Edge
from tests.checks.cases_files import EDGES as FILE_EDGES, FAILS as FILE_FAILS
from tests.checks.cases_identify import EDGES as IDENTIFY_EDGES, FAILS as IDENTIFY_FAILS
from tests.checks.cases_motion import EDGES as MOTION_EDGES, FAILS as MOTION_FAILS
from tests.checks.cases_plans import EDGES as PLAN_EDGES, FAILS as PLAN_FAILS
from tests.checks.cases_recording import EDGES as RECORDING_EDGES, FAILS as RECORDING_FAILS
from tests.checks.cases_rest import EDGES as REST_EDGES, FAILS as REST_FAILS
from tests.checks.cases_robots import EDGES as ROBOT_EDGES, FAILS as ROBOT_FAILS
from tests.checks.cases_sensors import EDGES as SENSOR_EDGES, FAILS as SENSOR_FAILS

FAILS: tuple[Case, ...] = (
    *FILE_FAILS, *RECORDING_FAILS, *SENSOR_FAILS, *MOTION_FAILS, *REST_FAILS, *ROBOT_FAILS, *IDENTIFY_FAILS,
    *PLAN_FAILS,
)  # fmt: skip
EDGES: tuple[Edge, ...] = (
    *FILE_EDGES, *RECORDING_EDGES, *SENSOR_EDGES, *MOTION_EDGES, *REST_EDGES, *ROBOT_EDGES, *IDENTIFY_EDGES,
    *PLAN_EDGES,
)  # fmt: skip
