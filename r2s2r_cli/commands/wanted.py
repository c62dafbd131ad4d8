"""What a stage would use if it ran now: its version, its settings, and its part of the robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from r2s2r_cli.installed import installed_words
from r2s2r_cli.measured import MEASURED
from r2s2r_cli.store.project import Iteration, Project
from r2s2r_cli.store.staleness import BORROWED, Wanted
from schemas.header import Provenance
from schemas.versions import STAGE_VERSIONS

if TYPE_CHECKING:
    from schemas.robot import Robot

ROBOT_PARTS: dict[str, dict[str, tuple[str, ...]]] = {
    "import": {"name": (), "rods": ("length_m", "cap_radius_m"), "cables": ("caps", "kind"), "sensors": ("cable",),
               "rest_caps_m": ()},
    "calibrate": {"name": (), "rods": ("name", "length_m", "cap_radius_m"), "sensors": ("cable",),
                  "cables": ("caps", "kind", "rest_length_m"), "pid": (), "limits": ()},
    "record": {"name": (), "motors": (), "pid": (), "limits": (), "sensors": ("cable", "slope_f_per_m", "offset_f")},
    "estimate": {"name": (), "rods": ("name", "length_m", "cap_radius_m", "radius_m", "parts"), "colors": (),
                 "cables": ("caps", "kind"), "sensors": ("cable", "slope_f_per_m", "offset_f"), "rest_caps_m": ()},
    "compare": {"name": (), "rods": (), "cables": (), "motors": (), "pid": (), "limits": (), "contact": (),
                "sensors": ("cable", "stiffness_n_per_m", "rest_length_m"), "rest_caps_m": ()},
    "floor": {"name": (), "rods": (), "cables": (), "motors": (), "pid": (), "contact": (), "sensors": (),
              "rest_caps_m": ()},
    "simulate": {"name": (), "rods": (), "cables": (), "motors": (), "pid": (), "limits": (), "contact": (),
                 "sensors": ("cable", "stiffness_n_per_m", "rest_length_m"), "rest_caps_m": ()},
    "plan": {"name": (), "rods": (), "cables": (), "motors": (), "pid": (), "limits": (), "contact": (),
             "sensors": ("cable", "stiffness_n_per_m", "rest_length_m"), "rest_caps_m": ()},
    "identify": {"name": (), "rods": (), "cables": (), "motors": (), "pid": (), "limits": (), "contact": (),
                 "sensors": ("cable", "stiffness_n_per_m", "rest_length_m"), "rest_caps_m": ()},
    "diagnose": {"name": (), "rods": (), "cables": (), "motors": (), "pid": (), "limits": (), "contact": (),
                 "sensors": (), "rest_caps_m": ()},
}  # fmt: skip
"""Which part of robot.toml each stage uses; a change elsewhere does not make its results stale."""


SHARED = {"compare": ("step_s", "frame_rate_hz", "rod_contact")}
"""Of every stage the settings of `simulate` that it uses."""


def robot_part(stage: str, robot: Robot) -> dict[str, Any]:
    """The part of the robot description that `stage` uses, as JSON values."""
    everything = robot.model_dump(mode="json")
    part: dict[str, Any] = {}
    for name, keys in ROBOT_PARTS.get(stage, {}).items():
        value = everything[name]
        part[name] = [{key: item[key] for key in keys} for item in value] if keys else value
    return part


def wanted(
    project: Project, iteration: Iteration | None, stage: str, overrides: dict[str, Any], flags: Mapping[str, Any]
) -> Wanted:
    """What `stage` would use if it ran now. Raises InputError or UsageError for wrong settings."""
    config = project.config(iteration, overrides).model_dump(mode="json", by_alias=True)
    settings = {**config.get(stage, {}), "flags": dict(flags)}
    if stage in SHARED:
        settings[BORROWED] = {name: config[BORROWED][name] for name in SHARED[stage]}
    own = installed_words() if stage == "diagnose" else ""
    if own:  # it looks for them beside the catalogue's
        settings["installed_effects"] = own
    return Wanted(STAGE_VERSIONS.get(stage, 1), settings, robot_part(stage, project.robot()))


def wanted_again(project: Project, iteration: Iteration | None, made: Provenance) -> Wanted:
    """What the stage that made an artifact would use now, with the same overrides and flags.

    A measurement does not go stale: what a robot did stays what it did, whatever the settings have become.
    """
    if made.stage in MEASURED:
        return Wanted(made.stage_version, made.settings, made.robot)
    return wanted(project, iteration, made.stage, made.overrides, made.settings.get("flags", {}))
