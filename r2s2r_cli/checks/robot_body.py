"""The robot description, its body: do rods, end caps and cables make one robot, and a measured one?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from r2s2r_cli.checks.base import Found, check, number
from schemas.robot import Robot

REST_TOLERANCE_M = 0.005
"""A rest pose measured with a rule; simulation starts from it and pulls the rods to their length."""
SITE_FACTOR = 1.5
"""Cables are tied to the surface of a cap or in it; a knot or ring may stand out by half a radius."""
MASS_PER_CUBE = 250.0
"""A rod of solid steel and a tenth as thick as long has 246 kg over the cube of its length in metres; the rods of the
3-bar robot have 4. Relative to the length, so that it holds for a robot of any size."""
BEYOND_TIP = 1.1
"""A part may stand out beyond the tip of its rod's cap by a tenth, as `calibrate` lets pass."""


@check(
    "error",
    Robot,
    what="there is one rest position for each end cap, and the rods have their length there, within 5 mm",
    why="the simulator starts from the rest pose; wrong lengths there are an explosion in the first step",
    fix="correct rest_caps_m or rods.length_m (cap centre to cap centre) in {file}",
)
def rest_pose_fits_rods(robot: Robot) -> Iterator[Found]:
    """A rest pose of another robot."""
    if len(robot.rest_caps_m) != robot.n_caps:
        yield Found("rest_caps_m", "the rest pose has another number of caps than the robot", str(robot.n_caps),
                    str(len(robot.rest_caps_m)))  # fmt: skip
        return
    caps = np.array(robot.rest_caps_m)
    for i, rod in enumerate(robot.rods):
        length = float(np.linalg.norm(caps[2 * i + 1] - caps[2 * i]))
        if abs(length - rod.length_m) > REST_TOLERANCE_M:
            yield Found("rest_caps_m", f"rod {i} ({rod.name}) has another length in the rest pose",
                        f"{number(rod.length_m, 1e3)} mm within {number(REST_TOLERANCE_M, 1e3)} mm",
                        f"{number(length, 1e3)} mm")  # fmt: skip


@check(
    "warning",
    Robot,
    what="the robot lies on the ground in its rest pose: its lowest cap touches z = 0 within 5 mm",
    why="a robot that starts in the air falls, and one that starts in the ground is thrown out",
    fix="add the difference to every z of rest_caps_m in {file}",
)
def rest_pose_on_ground(robot: Robot) -> Iterator[Found]:
    """A rest pose in the air or in the ground."""
    if len(robot.rest_caps_m) != robot.n_caps:
        return
    radius = np.repeat([rod.cap_radius_m for rod in robot.rods], 2)
    lowest = float((np.array(robot.rest_caps_m)[:, 2] - radius).min())
    if abs(lowest) > REST_TOLERANCE_M:
        yield Found("rest_caps_m", "the robot does not lie on the ground in its rest pose", "0 mm",
                    f"lowest point of a cap at {number(lowest, 1e3)} mm")  # fmt: skip


@check(
    "warning",
    Robot,
    what="cables are attached to their end caps: at most 1.5 cap radii from the centre",
    why="attachment points decide the torque on a rod; one at a wrong rod end turns it the wrong way",
    fix="correct sites_m of the named cable in {file}",
)
def sites_on_their_caps(robot: Robot) -> Iterator[Found]:
    """Attachment points away from their cap."""
    for i, cable in enumerate(robot.cables):
        for end, (cap, site) in enumerate(zip(cable.caps, cable.sites_m, strict=True)):
            rod = robot.rods[cap // 2]
            centre = np.array([0.0, 0.0, rod.length_m / 2 * (1 if cap % 2 else -1)])
            distance = float(np.linalg.norm(np.array(site) - centre))
            other = float(np.linalg.norm(np.array(site) + centre))
            if distance > SITE_FACTOR * rod.cap_radius_m:
                yield Found(f"cables.{i}.sites_m.{end}", f"cable {i} is attached away from cap {cap}",
                            f"at most {number(SITE_FACTOR * rod.cap_radius_m, 1e3)} mm from its centre",
                            f"{number(distance, 1e3)} mm" + _slip(distance, other, rod.length_m))  # fmt: skip


def _slip(own: float, other: float, rod: float) -> str:
    """What a wrong attachment point probably is; own, other: distance from its cap and the rod's other one [m]."""
    if own > 2 * rod:
        return ", which looks like another unit than metres"
    return ", nearer to the other cap of the rod" if other < own else ""


@check(
    "warning",
    Robot,
    what="no two cables join the same two end caps",
    why="two tendons can run in parallel, but usually one of the two has a wrong cap number and another edge no cable",
    fix="correct caps of one of the two in {file}, if they are not parallel on purpose",
)
def cables_join_other_caps(robot: Robot) -> Iterator[Found]:
    """Two cables between the same caps, in either order."""
    seen: dict[frozenset[int], int] = {}
    for i, cable in enumerate(robot.cables):
        first = seen.setdefault(frozenset(cable.caps), i)
        if first != i:
            a, b = sorted(cable.caps)
            yield Found(f"cables.{i}.caps", f"cables {first} and {i} join the same end caps", "a pair of caps for each",
                        f"caps {a} and {b} twice")  # fmt: skip


@check(
    "warning",
    Robot,
    what="no rod is heavier than one of solid steel that is a tenth as thick as long",
    why="grams typed for kilograms make every force a thousand times too small to move the robot",
    fix="give mass_kg of its parts in kilograms in {file}",
)
def rod_masses_plausible(robot: Robot) -> Iterator[Found]:
    """Rods too heavy for their length."""
    for i, rod in enumerate(robot.rods):
        mass, most = sum(part.mass_kg for part in rod.parts), MASS_PER_CUBE * rod.length_m**3
        if mass > most:
            j = int(np.argmax([part.mass_kg for part in rod.parts]))
            heaviest = f"{rod.parts[j].name} {number(rod.parts[j].mass_kg)} kg"
            yield Found(f"rods.{i}.parts.{j}.mass_kg", f"rod {i} ({rod.name}) is too heavy for its length: grams?",
                        f"at most {number(most)} kg for {number(rod.length_m, 1e3)} mm",
                        f"{number(mass)} kg, of which {heaviest}")  # fmt: skip


@check(
    "warning",
    Robot,
    what="the parts of a rod lie on it",
    why="a part far out dominates the moment of inertia, and is usually in millimetres",
    fix="give offset_m, length_m and radius_m of the part in metres in {file}",
)
def parts_on_their_rod(robot: Robot) -> Iterator[Found]:
    """Parts beyond the tips of their rod, or wider than it is long."""
    for i, rod in enumerate(robot.rods):
        tip = BEYOND_TIP * (rod.length_m / 2 + rod.cap_radius_m)
        for j, part in enumerate(rod.parts):
            reach = max(abs(part.offset_m) + part.length_m / 2, part.radius_m)
            if reach > tip:
                yield Found(f"rods.{i}.parts.{j}", f"part {part.name} does not lie on rod {i} ({rod.name})",
                            f"within {number(tip, 1e3)} mm of its middle", f"{number(reach, 1e3)} mm")  # fmt: skip


@check(
    "advice",
    Robot,
    what="the robot is one that was measured",
    why="numbers of an illustrative robot were made up, and so is everything computed with them",
    fix="r2s2r init ../threebar --robot threebar   # a measured one; or measure yours, and set illustrative = false",
)
def robot_was_measured(robot: Robot) -> Iterator[Found]:
    """A made-up robot."""
    if robot.illustrative:
        yield Found("illustrative", "this robot was made up", "a measured robot", robot.title)
