"""States of rigid rods, estimated or simulated: what must hold in every frame."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from r2s2r_cli.checks.base import AGAIN, REPORT, Found, beyond, check, number, worst
from r2s2r_cli.checks.geometry import SPEED_MAX_M_PER_S
from r2s2r_cli.checks.subjects import Run

UNIT_TOLERANCE = 1e-6
"""Rounding of a quaternion written as text with six digits and more."""
RIGID_M = 1e-3
"""Rods of an estimate are rigid by construction; 1 mm leaves room for files written in float32."""
AXIS_RAD = 1e-2
"""1 mm across a rod of 300 mm is 3 mrad."""
TURN_MAX_RAD_PER_S = 100.0
"""Both caps of a 0.3 m rod at the fastest sane speed, in opposite directions: 33 rad/s."""
CONTACT_HEIGHT_M = 0.020
"""A cap whose lowest point is higher than this does not touch the ground: six times the default clearance."""
_KINDS = ("estimate", "simulation")


@check(
    "error",
    Run,
    kinds=("recording", *_KINDS),
    what="quaternions have length 1",
    why="another length scales what it rotates; 0 rotates nothing",
    fix=f"{AGAIN}   # quaternions are xyzw, scalar last",
)
def quaternions_are_unit(run: Run) -> Iterator[Found]:
    """Quaternions that are no rotation."""
    for stream, name, axes in (("frames", "q_WR", ("frame", "rod")), ("camera_pose", "q_WC", ("sample",))):
        q = run.array(stream, name)
        if q is not None:
            norm = np.linalg.norm(q, axis=-1)
            off = beyond(norm, 1 - UNIT_TOLERANCE, 1 + UNIT_TOLERANCE)
            if (off > 0).any():
                yield Found(run.at(stream, name), "a quaternion is not of length 1", "1", worst(norm, off, axes))


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="the caps of each rod keep their distance within 1 mm, in every frame",
    why="rods are rigid; states with other lengths are no states of the robot",
    fix=REPORT,
)
def rods_are_rigid(run: Run) -> Iterator[Found]:
    """Rods that stretch."""
    if run.p_WE is None or not len(run.p_WE[1]):
        return
    location, p = run.p_WE
    for rod in range(p.shape[1] // 2):
        length = np.linalg.norm(p[:, 2 * rod + 1] - p[:, 2 * rod], axis=-1)
        middle = float(np.median(length))
        off = beyond(length, middle - RIGID_M, middle + RIGID_M)
        if (off > 0).any():
            yield Found(location, f"rod {rod} changes its length", f"{number(middle, 1e3)} mm within 1 mm",
                        worst(length, off, ("frame",), scale=1e3, unit="mm"))  # fmt: skip


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="the pose of each rod puts its middle and its axis where its caps are",
    why="caps and rod poses are two views of one state; where they differ, results depend on which one is read",
    fix=f"{AGAIN}   # z of a rod points to its odd cap, quaternions are xyzw",
)
def poses_match_caps(run: Run) -> Iterator[Found]:
    """Poses of other rods, other quaternion order, other direction."""
    p_WR, q_WR = run.array("frames", "p_WR"), run.array("frames", "q_WR")
    if p_WR is None or q_WR is None or run.p_WE is None:
        return
    p = run.p_WE[1]
    if p.shape[1] != 2 * p_WR.shape[1]:
        return
    even, odd = p[:, 0::2], p[:, 1::2]
    off = np.linalg.norm((even + odd) / 2 - p_WR, axis=-1)
    if (off > RIGID_M).any():
        yield Found(run.at("frames", "p_WR"), "a rod is not in the middle between its caps", "within 1 mm",
                    worst(off, off * (off > RIGID_M), ("frame", "rod"), scale=1e3, unit="mm"))  # fmt: skip
    angle = _angle(_axis(q_WR), odd - even)
    if (angle > AXIS_RAD).any():
        yield Found(run.at("frames", "q_WR"), "a rod does not point from its even to its odd cap", "within 0.6 degrees",
                    worst(angle, angle * (angle > AXIS_RAD), ("frame", "rod"), scale=180 / np.pi,
                          unit="degrees"))  # fmt: skip


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="caps and rods move at no more than 5 m/s and turn at no more than 100 rad/s",
    why="faster than anything this robot does: the smoother or the engine has run away",
    fix="look at the named frame; leave out the part of the run before it, or give the engine a smaller step",
)
def speeds_are_sane(run: Run) -> Iterator[Found]:
    """States that fly apart."""
    for name, limit, unit, axes in (
        ("v_WE", SPEED_MAX_M_PER_S, "m/s", ("frame", "cap")),
        ("v_WR", SPEED_MAX_M_PER_S, "m/s", ("frame", "rod")),
        ("w_WR", TURN_MAX_RAD_PER_S, "rad/s", ("frame", "rod")),
    ):
        velocity = run.array("frames", name)
        if velocity is not None:
            size = np.linalg.norm(velocity, axis=-1)
            fast = beyond(size, 0.0, limit)
            if (fast > 0).any():
                yield Found(run.at("frames", name), "a velocity is absurd", f"at most {limit:g} {unit}",
                            worst(size, fast, axes, unit=unit))  # fmt: skip


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="a cap in contact is at most 20 mm above the ground",
    why="contact forces and friction are fitted where contact is said to be",
    fix=f"{AGAIN}   # first compare estimate.contact_clearance_m in project.toml with the noise of the run",
)
def contacts_near_ground(run: Run) -> Iterator[Found]:
    """Contacts in the air."""
    contact = run.array("frames", "contact")
    if contact is None or run.robot is None or run.p_WE is None:
        return
    height = run.p_WE[1][..., 2] - np.repeat([rod.cap_radius_m for rod in run.robot.rods], 2)
    high = np.where(contact, beyond(height, -np.inf, CONTACT_HEIGHT_M), 0.0)
    if (high > 0).any():
        yield Found(run.at("frames", "contact"), "a cap high above the ground is said to touch it",
                    f"its lowest point below {number(CONTACT_HEIGHT_M, 1e3)} mm",
                    worst(height, high, ("frame", "cap"), scale=1e3, unit="mm"))  # fmt: skip


@check(
    "error",
    Run,
    kinds=_KINDS,
    what="the length of each cable is the distance of its caps within 1 mm",
    why="another length means other cables than in robot.toml, or another order",
    fix=f"{AGAIN}   # first compare [[cables]] in robot.toml with the robot",
)
def lengths_match_caps(run: Run) -> Iterator[Found]:
    """Lengths that are not between the caps of their cable."""
    length = run.array("frames", "length")
    if length is None or run.robot is None or run.p_WE is None:
        return
    p = run.p_WE[1]
    first, second = (np.array([cable.caps[i] for cable in run.robot.cables]) for i in (0, 1))
    off = np.abs(length - np.linalg.norm(p[:, second] - p[:, first], axis=-1))
    far = off * (off > RIGID_M)
    if (far > 0).any():
        yield Found(run.at("frames", "length"), "the length of a cable is not the distance of its caps",
                    "within 1 mm", "off by " + worst(off, far, ("frame", "cable"), scale=1e3, unit="mm"))  # fmt: skip


def _axis(q: np.ndarray) -> np.ndarray:
    """Z axis of the frame that unit quaternions (..., xyzw) rotate into the world."""
    x, y, z, w = np.moveaxis(q, -1, 0)
    return np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=-1)


def _angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle between vectors [rad]; well-behaved near 0 and pi, 0 where one of them is 0."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1))
