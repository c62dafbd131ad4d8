"""Draws docs/concepts/rig-effects/*.png and writes rig-effects.md.

`.venv/bin/python docs/concepts/rig_effects_picture.py`, about half a minute.
"""

from __future__ import annotations

import inspect
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: TID253 - a script
from matplotlib.figure import Figure  # noqa: TID253
from rig_effects_shown import CAMERA, EXPERIMENTS, ROBOT, Experiment, Sight, trace

from r2s2r_cli.rig.camera.camera import RigCamera
from r2s2r_cli.rig.effects.base import EffectSection
from r2s2r_cli.rig.effects.parameters import Effects
from r2s2r_cli.rig.plant import Plant
from r2s2r_cli.rig.world import World

HERE = Path(__file__).parent
OFF, ON = "#8a8f98", "#c0392b"
HEAD = """\
# Effects of the rig

What each effect of a [world file](../reference/world.md) does to the virtual robot: grey without it, red with it, all
else equal. They are laws of MuJoCo's model and of the rig's motors and sensors, written for the rig alone; where the
form differs from that of the catalogue which `diagnose` chooses from, the text says so. Written and drawn by
`rig_effects_picture.py` from the experiments of `rig_effects_shown.py`, which are run as tests as well:
`pytest -m slow tests/rig/test_effects_shown.py`.

Numbers are chosen to be seen, larger than on a robot that one would use.
"""


def curves(one: Experiment) -> Figure:
    """What is seen against time, or against the other axis."""
    figure = Figure(figsize=(4.2, 2.4), dpi=90, layout="constrained")
    axes = figure.add_subplot()
    for on, color in ((False, OFF), (True, ON)):
        _, y, x = trace(one, on=on)
        axes.plot(x, y, color=color, linewidth=1.4)
    axes.set_xlabel(one.against_unit, fontsize=8)
    axes.set_ylabel(one.unit, fontsize=8)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3)
    return figure


def pictures(one: Sight) -> Figure:
    """What the camera gives of the robot at rest (or of a gait step), without and with the effect."""
    figure = Figure(figsize=(5.4, 2.2), dpi=64, layout="constrained")
    for i, (title, image) in enumerate(frames(one)):
        axes = figure.add_subplot(1, 2, i + 1)
        axes.imshow(image, cmap="viridis", interpolation="nearest")
        axes.set_title(title, fontsize=8)
        axes.set_axis_off()
    return figure


def frames(one: Sight) -> list[tuple[str, np.ndarray]]:
    """Two pictures of the same robot."""
    found = []
    for on in (False, True):
        world = World.model_validate({"effects": {one.id: dict(one.table)} if on else {}})
        plant = Plant(ROBOT, world)
        camera = RigCamera(ROBOT, world.seen(), seed=1)
        picture = camera.capture(3, one.at_s, plant.truth().p_WE)
        depth = picture.depth * world.camera.depth_scale
        image = picture.color if one.what == "color" else np.where(picture.depth == 0, np.nan, depth)
        found.append(("with" if on else "without", image[90:390:2, 120:520:2]))
    return found


def section(name: str, says: str, table: object) -> str:
    """One effect of the page."""
    model = Effects.model_fields[name].annotation
    kinds = [kind for kind in model.__args__ if isinstance(kind, type) and issubclass(kind, EffectSection)]
    what = " ".join(inspect.cleandoc(kinds[0].__doc__ or "").split())
    how = next(
        " ".join(inspect.cleandoc(method.__doc__ or "").split())
        for key in ("law", "options", "seen")
        if (method := kinds[0].__dict__.get(key)) is not None
    )
    return (
        f"## `{name}`\n\n{what}\n\nForm: {how[0].lower() + how[1:]}\n\n"
        f"![{name}: {says}](rig-effects/{name}.png)\n\nPicture: {says}. `[effects.{name}]` {settings(table)}\n"
    )


def settings(table: object) -> str:
    """The numbers of a picture."""
    assert isinstance(table, dict)  # noqa: S101 - of the experiments
    return ", ".join(f"`{key} = {value}`" for key, value in table.items())


def main() -> None:
    """Draw everything anew."""
    folder = HERE / "rig-effects"
    folder.mkdir(exist_ok=True)
    parts = {}
    for one in (*EXPERIMENTS, *CAMERA):
        figure = curves(one) if isinstance(one, Experiment) else pictures(one)
        FigureCanvasAgg(figure)
        figure.savefig(folder / f"{one.id}.png", metadata={"Software": None})
        parts[one.id] = section(one.id, one.says, dict(one.table))
    page = "\n".join([HEAD, *(parts[name] for name in Effects.model_fields if name in parts)])
    (HERE / "rig-effects.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
