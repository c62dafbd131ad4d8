"""What the rig's camera sees, and how badly: `python examples/10_rig_camera/run.py --out DIR`.

Prints what a picture costs and draws `rig-camera.png`. What it shows: docs/concepts/rig-camera.md.
"""

from __future__ import annotations

import argparse
import io
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from r2s2r_cli.rig.camera.camera import Picture, RigCamera
from r2s2r_cli.rig.camera.settings import CameraSettings, DepthNoise, Distractor, Occluder
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.robot import Robot

ROBOT = Robot.model_validate(tomllib.loads(robot_toml("threebar")))
CAPS = np.array(ROBOT.rest_caps_m)
ARM = Occluder(a_m=(-0.5, 0.35, 0.35), b_m=(-0.17, 0.08, 0.25), radius_m=0.03)
DISC = Distractor(center_m=(0.3, 0.22), radius_m=0.03, rgb=(40, 150, 60))
CLOSE = (slice(180, 300), slice(240, 400))
"""The rows and columns of the close-ups."""

PARTS: dict[str, dict[str, Any]] = {
    "white noise, 1.2 mm z²": {"sd_per_m": 0.0012, "correlated_share": 0.0},
    "correlated noise, 1.2 mm z²": {"sd_per_m": 0.0012, "correlated_share": 1.0},
    "disparity steps of 1/8 px": {"disparity_step_px": 0.125},
    "frayed, flying and missing edges": {"lateral_px": 0.5, "flying_share": 0.5, "edge_hole_share": 0.25},
}
"""Parts of the depth noise, each alone."""


def only(part: dict[str, Any]) -> CameraSettings:
    """A camera with nothing wrong but this."""
    ideal = CameraSettings().ideal()
    return ideal.model_copy(update={"depth": DepthNoise.model_validate({**ideal.depth.model_dump(), **part})})


def picture(settings: CameraSettings, v_WE: np.ndarray | None = None) -> Picture:
    """One frame of the robot at rest; v_WE: velocities of the caps [m/s]."""
    return RigCamera(ROBOT, settings, seed=1).capture(3, 0.1, CAPS, v_WE)


def errors(settings: CameraSettings) -> np.ndarray:
    """Depth minus true depth [mm], (v, u), NaN where unknown."""
    seen, truth = (picture(s).depth.astype(float) for s in (settings, CameraSettings().ideal()))
    return np.where(seen > 0, 1000 * settings.depth_scale * (seen - truth), np.nan)


def cost(settings: CameraSettings, v_WE: np.ndarray | None = None, count: int = 60) -> float:
    """CPU time of a picture [ms], median."""
    camera, spent = RigCamera(ROBOT, settings), []
    for number in range(count + 1):
        begin = time.process_time()
        camera.capture(number, number / 30, CAPS, v_WE)
        spent.append(time.process_time() - begin)
    return float(1000 * np.median(spent[1:]))


def draw(path: Path) -> None:
    """All of it in one picture."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    sheet = Figure(figsize=(13.0, 5.6), dpi=75, layout="constrained")
    FigureCanvasAgg(sheet)
    grid = sheet.subplots(2, 4)
    moving = np.tile([0.8, 0.3, 0.0], (6, 1))
    crowded = CameraSettings(occluders=(ARM,), distractors=(DISC,))
    seen, fast = picture(crowded), picture(CameraSettings(), moving)
    depth = np.where(seen.depth > 0, seen.depth * crowded.depth_scale, np.nan)

    def show(axes: Any, title: str, image: np.ndarray, **options: Any) -> Any:
        axes.set(xticks=[], yticks=[])
        axes.set_title(title, fontsize=9)
        return axes.imshow(image, interpolation="nearest", **options)

    show(grid[0, 0], "colour, an arm, a green disc", seen.color)
    bar = show(grid[0, 1], "depth [m]; grey: unknown", depth, cmap="viridis", vmin=1.1, vmax=1.46)
    sheet.colorbar(bar, ax=grid[0, 1], shrink=0.75)
    show(grid[0, 2], "close-up at rest", picture(CameraSettings()).color[CLOSE])
    show(grid[0, 3], "close-up at 0.85 m/s", fast.color[CLOSE])
    for axes, (title, part) in zip(grid[1], PARTS.items(), strict=True):
        last = show(axes, title, errors(only(part))[CLOSE], cmap="RdBu_r", vmin=-12, vmax=12)
    for axes in [grid[0, 1], *grid[1]]:
        axes.set_facecolor("#c8c8c8")
    sheet.colorbar(last, ax=list(grid[1]), label="depth error [mm]", shrink=0.9)
    path.parent.mkdir(parents=True, exist_ok=True)
    drawn = io.BytesIO()
    sheet.savefig(drawn, metadata={"Software": None})
    # Noise does not compress; 256 colours do.
    few = Image.open(drawn).convert("RGB").quantize(256, method=Image.Quantize.MAXCOVERAGE)
    few.save(path, optimize=True)


def main(out: Path, say: Callable[[str], None] = print, count: int = 60) -> None:
    """Draw, and say what a picture costs."""
    draw(out / "rig-camera.png")
    full = CameraSettings()
    say(f"{'640 x 480 px, one core':34s} {'CPU per picture':>16s}")
    for words, settings, v_WE in (
        ("without noise", full.ideal(), None),
        ("with all of it", full, None),
        ("with all of it, moving at 0.85 m/s", full, np.tile([0.8, 0.3, 0.0], (6, 1))),
    ):
        say(f"{words:34s} {cost(settings, v_WE, count):13.1f} ms")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out"))
    main(parser.parse_args().out)
