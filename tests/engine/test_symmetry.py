"""Symmetries: the robot has three equal rods, and the ground no favourite direction."""

from __future__ import annotations

from dataclasses import replace

import roma
import torch
from torch import Tensor

from r2s2r_cli.engine import Parameters, State, Structure, end_caps
from tests.support.engine import random_gait, shaken, simulator, threebar, threebar_engine, vector

STEPS = 400
"""Of 1 ms: long enough for impacts, stick and slip, short enough that rounding has not grown."""
NEXT = (1, 2, 0)
"""The rod that rod i is renamed to."""


def cable_renaming(structure: Structure) -> list[tuple[int, bool]]:
    """For each cable the cable that it is renamed to, and whether that one runs the other way."""
    ends = [cable.caps for cable in threebar().cables]
    kinds = [cable.kind for cable in threebar().cables]
    renamed = []
    for (a, b), kind in zip(ends, kinds, strict=True):
        x, y = (2 * NEXT[cap // 2] + cap % 2 for cap in (a, b))
        found = [(k, (p, q) != (x, y)) for k, (p, q) in enumerate(ends) if {p, q} == {x, y} and kinds[k] == kind]
        assert len(found) == 1
        renamed += found
    return renamed


def symmetric() -> tuple[Structure, Parameters, State]:
    """The robot with the attachment points of its cables turned so that all rods are alike to rounding: robot.toml
    gives them to the micrometre, each in the frame of its own rod."""
    structure, theta, start = threebar_engine()
    p_BS = theta.p_BS.clone()
    # Rod 0's points, carried over by the renaming to the rods 1 and 2.
    for _ in range(2):
        for k, (to, turned) in enumerate(cable_renaming(structure)):
            for end in (0, 1):
                rod, target = structure.cable_rods[k][end], structure.cable_rods[to][1 - end if turned else end]
                if target > rod:
                    p_BS[:, to, 1 - end if turned else end] = p_BS[:, k, end]
    alike = {name: getattr(theta, name).mean() + 0 * getattr(theta, name) for name in ("mass", "rest", "speed_in")}
    return structure, replace(theta, p_BS=p_BS, **alike), start


def renamed_state(structure: Structure, s: State) -> State:
    """The same robot with its rods and cables renamed."""
    rods = [NEXT.index(i) for i in range(3)]
    cables = [to for to, _ in cable_renaming(structure)]
    place = [structure.actuated.index(cables[k]) for k in structure.actuated]
    back = [place.index(i) for i in range(len(place))]
    return State(
        s.p_WB[..., rods, :], s.q_WR[..., rods, :], s.v_WB[..., rods, :], s.w_R[..., rods, :],
        s.rest[..., back], s.winding[..., back],
    )  # fmt: skip


def renamed_commands(structure: Structure, u: Tensor) -> Tensor:
    """Commands (B, row, actuated) of the renamed cables."""
    cables = [to for to, _ in cable_renaming(structure)]
    place = [structure.actuated.index(cables[k]) for k in structure.actuated]
    return u[..., [place.index(i) for i in range(len(place))]]


def gait(structure: Structure, theta: Parameters, start: State, u: Tensor) -> State:
    """The state after STEPS of commands (B, row, actuated)."""
    hold = STEPS // u.shape[1]
    return simulator(structure).rollout(theta, start, u, hold=hold, every=STEPS, substeps=1).at(-1)


def scattered(start: State, seed: int) -> State:
    """Robots in odd poses close above the ground, moving."""
    return shaken(start, 6, seed=seed, position=0.002, angle=0.03, speed=0.2, spin=0.5)


def test_renaming_a_robot_twice_and_thrice() -> None:
    """The renaming is a permutation of order three that keeps cables on their rods."""
    structure, _, _ = symmetric()
    cables = [to for to, _ in cable_renaming(structure)]
    assert sorted(cables) == list(range(9))
    assert [cables[cables[cables[k]]] for k in range(9)] == list(range(9))


def test_a_renamed_start_gives_the_renamed_trajectory() -> None:
    """Three-fold symmetry: rods and cables renamed in start and commands, the robot moves as before, renamed, to
    rounding; the motion compared is of centimetres."""
    structure, theta, rest = symmetric()
    start, u = scattered(rest, 1), random_gait(2, 6, batch=6, seed=2)
    one = renamed_state(structure, gait(structure, theta, start, u))
    other = gait(structure, theta, renamed_state(structure, start), renamed_commands(structure, u))
    assert float((one.p_WB - other.p_WB).abs().max()) < 1e-9
    assert float((one.w_R - other.w_R).abs().max()) < 1e-6
    assert float((one.p_WB - renamed_state(structure, start).p_WB).abs().max()) > 0.01


def test_a_turned_start_gives_the_turned_trajectory() -> None:
    """The ground has no direction: turned about the vertical and moved along the ground, the robot moves as before,
    turned and moved."""
    structure, theta, rest = threebar_engine()
    start, u = scattered(rest, 3), random_gait(2, 6, batch=6, seed=4)
    turn, shift = roma.rotvec_to_unitquat(vector(0.0, 0.0, 1.1)), vector(3.0, -2.0, 0.0)
    R = roma.unitquat_to_rotmat(turn)

    def moved(s: State) -> State:
        return replace(
            s, p_WB=s.p_WB @ R.T + shift, v_WB=s.v_WB @ R.T, q_WR=roma.quat_product(turn.expand_as(s.q_WR), s.q_WR)
        )

    one, other = moved(gait(structure, theta, start, u)), gait(structure, theta, moved(start), u)
    assert float((end_caps(theta, one) - end_caps(theta, other)).abs().max()) < 1e-8


def test_a_mirrored_start_gives_the_mirrored_trajectory() -> None:
    """Mirrored in the plane y = 0, robot and start give the mirrored motion."""
    structure, theta, rest = threebar_engine()
    start, u = scattered(rest, 5), random_gait(2, 6, batch=6, seed=6)
    flip, turning = vector(1.0, -1.0, 1.0), vector(-1.0, 1.0, -1.0)

    def mirrored(s: State) -> State:
        # Reflected in the world and in the rod's own frame (y -> -y there too): a rotation again, (-x, y, -z, w).
        q = s.q_WR * torch.cat([turning, vector(1.0)])
        return replace(s, p_WB=s.p_WB * flip, v_WB=s.v_WB * flip, q_WR=q, w_R=s.w_R * turning)

    other = gait(structure, replace(theta, p_BS=theta.p_BS * flip), mirrored(start), u)
    one = mirrored(gait(structure, theta, start, u))
    assert float((end_caps(theta, one) - end_caps(theta, other)).abs().max()) < 1e-8


def test_units_do_not_matter() -> None:
    """In other units of length, time and mass, with all numbers scaled accordingly, the robot moves the same: no
    constant with a dimension hides in the ground contact (rod contact has a reach of its own and is left out)."""
    structure, theta, rest = threebar_engine()
    structure = replace(structure, rod_contact=False)
    start, u = scattered(rest, 7), random_gait(2, 6, batch=6, seed=8)
    m, s, kg = 8.0, 4.0, 2.0  # powers of two: the scaling itself rounds nothing
    lengths = ("p_BE", "cap_radius", "rod_radius", "p_BS", "rest", "tendon_rest", "rest_min", "rest_max")
    scale = dict.fromkeys(lengths, m) | {"mass": kg, "inertia": kg * m * m, "impact_speed": m / s}
    scale |= {"stiffness": kg / s**2, "damping": kg / s, "gravity": m / s**2, "speed_in": m / s, "speed_out": m / s}
    other = replace(theta, **{name: getattr(theta, name) * factor for name, factor in scale.items()})
    scaled = replace(
        start, p_WB=start.p_WB * m, v_WB=start.v_WB * m / s, w_R=start.w_R / s, rest=start.rest * m,
        winding=start.winding * m / s,
    )  # fmt: skip
    end = gait(structure, theta, start, u)
    run = simulator(structure).rollout(other, scaled, u, step=1e-3 * s, hold=STEPS // 2, every=STEPS, substeps=1).at(-1)
    assert float((run.p_WB / m - end.p_WB).abs().max()) < 1e-8


def test_bodies_of_revolution_are_no_special_case() -> None:
    """The step for any body, with off-axis caps and full inertias, gives the same for rods as the shorter one does."""
    structure, theta, rest = threebar_engine()
    start, u = scattered(rest, 9), random_gait(2, 6, batch=6, seed=10)
    one, other = (gait(replace(structure, axial=axial), theta, start, u) for axial in (True, False))
    assert float((end_caps(theta, one) - end_caps(theta, other)).abs().max()) < 1e-9


def test_a_turned_body_frame_changes_nothing() -> None:
    """Rods described in frames that are turned against their axes (caps, inertia and attachments all off the axes)
    move as before."""
    structure, theta, rest = threebar_engine()
    structure = replace(structure, axial=False)
    start, u = scattered(rest, 11), random_gait(2, 6, batch=6, seed=12)
    turn = roma.rotvec_to_unitquat(vector(0.4, -0.7, 0.2))
    R = roma.unitquat_to_rotmat(turn)
    described = replace(theta, p_BE=theta.p_BE @ R, p_BS=theta.p_BS @ R, inertia=R.T @ theta.inertia @ R)
    turned = replace(start, q_WR=roma.quat_product(start.q_WR, turn.expand_as(start.q_WR)), w_R=start.w_R @ R)
    one, other = gait(structure, theta, start, u), gait(structure, described, turned, u)
    assert float((end_caps(theta, one) - end_caps(described, other)).abs().max()) < 1e-8
