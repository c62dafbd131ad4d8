"""Simulated runs as one self-contained page with a player: orbit, zoom, play, scrub. No network, below 1 MB."""

from __future__ import annotations

import base64
import json
import math
from importlib import resources
from typing import Any

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.figure import rod_color
from r2s2r_cli.views.page import Page
from r2s2r_cli.views.simulation import strongest
from r2s2r_cli.views.simulation_scene import SLACK_N, rotated
from schemas.robot import Robot

FRAME_RATE_HZ = 30.0
"""The player interpolates between frames; more of them show nothing that a screen can."""
BYTES_MAX = 600_000
"""Of all packed frames together, before base64 makes four bytes of three; longer runs get fewer frames a second."""
_INT16, _BYTE, _SIGNED = 32767, 255, 127
_SCRIPTS = ("playback_scene.js", "playback_page.js", "playback.js")


def playback_page(page: Page, data: ArtifactData, robot: Robot) -> bytes:
    """The page as UTF-8 HTML: a player of all runs of a simulation or plan, and what `page` says."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    values = json.dumps(playback_data(data, robot), separators=(",", ":"), ensure_ascii=True)
    text = environment.from_string(template("playback.html")).render(
        page=page,
        encoded=lambda png: base64.b64encode(png).decode(),
        data=values.replace("<", "\\u003c"),  # a name must not end the script element
        scripts="\n".join(template(name) for name in _SCRIPTS),
    )
    return text.encode()


def playback_data(data: ArtifactData, robot: Robot) -> dict[str, Any]:
    """What the player reads: the robot's geometry in SI, and every run's frames as base64 of small integers."""
    share = BYTES_MAX / sum(len(data.groups[f"runs/{run}/frames"]["t"]) * _frame_bytes(robot) for run in data.runs())
    return {"robot": _robot(robot), "runs": [_run(data, run, robot, share) for run in data.runs()]}


def template(name: str) -> str:
    """A file of the templates beside the views."""
    return resources.files("r2s2r_cli.views").joinpath("templates", name).read_text("utf-8")


def _frame_bytes(robot: Robot) -> int:
    return 4 + 14 * len(robot.rods) + 2 * len(robot.cables) + math.ceil(robot.n_caps / 8) + len(robot.motors)


def _robot(robot: Robot) -> dict[str, Any]:
    motor = {cable: k for k, cable in enumerate(robot.actuated)}
    rods = []
    for i, rod in enumerate(robot.rods):
        mass = sum(part.mass_kg for part in rod.parts)
        com = sum(part.mass_kg * part.offset_m for part in rod.parts) / mass
        shape = {"length": rod.length_m, "radius": rod.radius_m, "capRadius": rod.cap_radius_m}
        rods.append({**shape, "mass": mass, "com": com, "color": rod_color(2 * i)})
    cables = [{"caps": c.caps, "sites": c.sites_m, "motor": motor.get(k, -1)} for k, c in enumerate(robot.cables)]
    pid = {"min": robot.pid.min_length_m, "range": robot.pid.range_m, "tolerance": robot.pid.tolerance}
    size = max(rod.length_m for rod in robot.rods)
    return {"rods": rods, "cables": cables, "motors": len(robot.motors), "pid": pid, "size": size}


def _run(data: ArtifactData, run: str, robot: Robot, share: float) -> dict[str, Any]:
    frames, facts = data.groups[f"runs/{run}/frames"], data.groups[f"runs/{run}"].attributes
    rows = kept_frames(frames["t"], share)
    p_WR, tension = frames["p_WR"][rows], frames["tension"][rows]
    scale, top = max(float(np.abs(p_WR).max()), 0.1) / _INT16, strongest(frames)
    levels = np.where(tension > SLACK_N, np.clip(np.round(_BYTE * tension / top), 1, _BYTE), 0)
    spare = np.clip(np.round(1e3 * (frames["rest_length"][rows] - _spans(frames, robot, rows))), 0, _BYTE)
    return {
        "name": run,
        "title": f"{run}: {facts['policy']}, {facts['control']}",
        "t": packed(frames["t"][rows] - frames["t"][0], "<f4"),
        "scale": scale,
        "p": packed(np.round(p_WR / scale), "<i2"),
        "q": packed(np.round(_INT16 * frames["q_WR"][rows]), "<i2"),
        "top": top,
        "tension": packed(levels, "u1"),
        "spare": packed(spare, "u1"),
        "contact": packed(np.packbits(frames["contact"][rows], axis=1, bitorder="little"), "u1"),
        "control": packed(np.round(_SIGNED * _control(data.group(run, "commands"), frames["t"][rows], robot)), "i1"),
        "intervals": _intervals(data.group(run, "intervals"), float(frames["t"][0])),
    }


def kept_frames(t: np.ndarray, share: float) -> np.ndarray:
    """Frames that the player gets: about FRAME_RATE_HZ, no more than `share` of them all, the first and last always."""
    span = float(t[-1] - t[0])
    count = min(len(t), max(2, math.floor(min(span * FRAME_RATE_HZ, share * len(t)))))
    return np.unique(np.searchsorted(t, np.linspace(t[0], t[-1], count) - 1e-9).clip(max=len(t) - 1))


def _spans(frames: Group, robot: Robot, rows: np.ndarray) -> np.ndarray:
    """Distance of the two attachment points of every cable [m], (row, cable)."""
    ends = np.array([cable.caps for cable in robot.cables]) // 2
    sites = np.array([cable.sites_m for cable in robot.cables])
    p_WS = frames["p_WR"][rows][:, ends] + rotated(frames["q_WR"][rows][:, ends], sites)
    return np.asarray(np.linalg.norm(p_WS[:, :, 1] - p_WS[:, :, 0], axis=-1))


def _control(commands: Group | None, t: np.ndarray, robot: Robot) -> np.ndarray:
    """Motor commands at the frames: the last one before each, 0 where there is none."""
    if commands is None or "control" not in commands or not len(commands["t"]):
        return np.zeros((len(t), len(robot.motors)))
    row = np.searchsorted(commands["t"], t + 1e-9, side="right") - 1
    control = np.clip(np.nan_to_num(commands["control"]), -1, 1)
    return np.asarray(np.where((row < 0)[:, None], 0.0, control[np.maximum(row, 0)]))


def _intervals(intervals: Group | None, start: float) -> list[dict[str, Any]]:
    if intervals is None:
        return []
    spans = zip(intervals["t_first"], intervals["t_last"], intervals["target"], strict=True)
    return [{"start": float(a) - start, "end": float(b) - start, "target": x.round(4).tolist()} for a, b, x in spans]


def packed(values: np.ndarray, dtype: str) -> str:
    """As base64, row after row."""
    return base64.b64encode(np.ascontiguousarray(values.astype(dtype)).tobytes()).decode("ascii")
