"""The page of a comparison: what was found, a player of the real and the simulated robots together, tables, pictures.

No network, nothing beside it. The player shows end caps at equal shares of each target interval, as they are compared:
in step (every robot at the same share of the same interval: what differs is where it is) or each by its own clock.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.compare import REAL, model_color
from r2s2r_cli.views.figure import rod_color
from r2s2r_cli.views.page import Page, Picture
from r2s2r_cli.views.simulation_playback import packed, template
from schemas.robot import Robot

_INT16 = 32767
_SCRIPTS = ("playback_scene.js", "playback_page.js", "compare.js")


def playback_page(page: Page, data: ArtifactData, robot: Robot, shown: Mapping[str, tuple[Picture, ...]]) -> bytes:
    """The page as UTF-8 HTML. shown: pictures by run, those of `page` stand before them."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    values = json.dumps(playback_data(data, robot), separators=(",", ":"), ensure_ascii=True)
    text = environment.from_string(template("compare.html")).render(
        page=page, shown=shown,
        encoded=lambda png: base64.b64encode(png).decode(),
        data=values.replace("<", "\\u003c"),  # a name must not end the script element
        scripts="\n".join(template(name) for name in _SCRIPTS),
    )  # fmt: skip
    return text.encode()


def playback_data(data: ArtifactData, robot: Robot) -> dict[str, Any]:
    """What the player reads: the robot's shape in SI, and every run's caps as base64 of small integers."""
    names = [name.decode() for name in data.groups["models"]["name"].tolist()]
    rods = [
        {"radius": rod.radius_m, "capRadius": rod.cap_radius_m, "color": rod_color(2 * i)}
        for i, rod in enumerate(robot.rods)
    ]
    shape = {"rods": rods, "cables": [list(cable.caps) for cable in robot.cables],
             "size": max(rod.length_m for rod in robot.rods)}  # fmt: skip
    return {"robot": shape, "runs": [_run(data, run, names) for run in data.runs()]}


def _run(data: ArtifactData, run: str, names: list[str]) -> dict[str, Any]:
    real, simulated = data.groups[f"runs/{run}/real"], data.groups[f"runs/{run}/simulated"]
    actors = [_actor("real robot", REAL, real["duration"], real["p_WE"], real["com"])]
    for k, name in enumerate(names):
        n = int(simulated["compared"][k])
        if n:
            actors.append(_actor(name, model_color(k), simulated["duration"][k, :n], simulated["p_WE"][k, :n],
                                 simulated["com"][k, :n]))  # fmt: skip
    return {"name": run, "actors": actors, "errors": _errors(simulated, names)}


def _actor(name: str, color: str, duration: np.ndarray, p_WE: np.ndarray, com: np.ndarray) -> dict[str, Any]:
    """p_WE (interval, point, cap, 3), com (interval, point, 3) [m]; duration (interval,) [s]."""
    scale = max(float(np.abs(p_WE).max()), 0.1) / _INT16
    flat = p_WE.reshape(-1, *p_WE.shape[2:])
    return {
        "name": name, "color": color, "points": p_WE.shape[1], "duration": duration.round(4).tolist(), "scale": scale,
        "p": packed(np.round(flat / scale), "<i2"), "com": packed(np.round(com.reshape(-1, 3)[:, :2] / scale), "<i2"),
    }  # fmt: skip


def _errors(simulated: Group, names: list[str]) -> list[dict[str, Any]]:
    """How far the caps are off at the end of each interval [mm], by simulator, for the timeline."""
    rows = [1e3 * simulated["segment_end"][k, : int(simulated["compared"][k])] for k in range(len(names))]
    return [{"name": name, "mm": row.round(1).tolist()} for name, row in zip(names, rows, strict=True)]
