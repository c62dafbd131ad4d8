"""How far a robot may go from its start before the camera loses it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Scalar
from schemas.robot import Robot

_DOWN = 0.1
"""Least fall of a ray, its length being 1: a camera that looks to the horizon has no edge there."""


def reach_seen(estimate: ArtifactData, robot: Robot) -> float | None:
    """The least over the runs of an estimate that a camera saw [m]; None where there is none, or none looks down."""
    found = []
    for run in estimate.runs():
        camera = estimate.group(run, "camera")
        if camera is not None and "X_WC" in camera.datasets:
            found.append(view_reach(camera["X_WC"], camera.attributes, robot))
    known = [one for one in found if one is not None]
    return min(known) if known else None


def view_reach(X_WC: np.ndarray, camera: Mapping[str, Scalar], robot: Robot) -> float | None:
    """Of a robot that starts in the middle of the picture: how far its centre may go over the ground, whatever the
    direction, so that every cap stays in the picture [m]; 0 where it does not fit at all.

    X_WC: pose of the camera (4, 4), z down the line of sight. camera: width, height, fx, fy, cx, cy [px]. None for a
    camera of which a corner does not see the floor.
    """
    fx, fy, cx, cy, width, height = (float(camera[name]) for name in ("fx", "fy", "cx", "cy", "width", "height"))
    corners = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    rays_C = np.column_stack([(corners - [cx, cy]) / [fx, fy], np.ones(4)])
    rays = (rays_C / np.linalg.norm(rays_C, axis=1, keepdims=True)) @ X_WC[:3, :3].T
    if (rays[:, 2] > -_DOWN).any():
        return None
    p_WE = np.array(robot.rest_caps_m)
    out = float(np.linalg.norm(p_WE[:, :2] - p_WE[:, :2].mean(axis=0), axis=1).max()) + robot.rods[0].cap_radius_m
    # At the height of its highest cap the picture shows least of the room.
    top = float(p_WE[:, 2].max())
    seen = X_WC[:2, 3] + rays[:, :2] * ((top - X_WC[2, 3]) / rays[:, 2])[:, None]
    along = np.roll(seen, -1, axis=0) - seen
    normal = np.column_stack([-along[:, 1], along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    edge = np.abs(((seen.mean(axis=0) - seen) * normal).sum(axis=1))
    return max(0.0, float(edge.min()) - out)


def far(simulated: ArtifactData) -> dict[str, float]:
    """How far the middle of the caps comes from where it started, over the ground [m], by run."""
    found = {}
    for run in simulated.runs():
        frames = simulated.group(run, "frames")
        if frames is not None:
            xy = frames["p_WE"].mean(axis=1)[:, :2]
            found[run] = float(np.linalg.norm(xy - xy[0], axis=1).max())
    return found
