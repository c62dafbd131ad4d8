"""The texts that `init` writes beside `project.toml`."""

from __future__ import annotations

from r2s2r_cli.stages.init.attachment import Mode
from r2s2r_cli.stages.init.robots import robot_toml
from r2s2r_cli.stages.init.sample import kinematic_sample

SAMPLE_STEM = "sample"


def init_texts(robot: str, attachment: Mode = "surface", *, sample_seed: int | None = None) -> dict[str, str]:
    """File name -> text: `robot.toml`, and with a seed `sample.csv` and its sidecar `sample.toml`.

    Raises UsageError for an unknown robot or attachment, or a sample of a robot that is no 3-bar prism.
    """
    texts = {"robot.toml": robot_toml(robot, attachment)}
    if sample_seed is not None:
        texts[f"{SAMPLE_STEM}.csv"], texts[f"{SAMPLE_STEM}.toml"] = kinematic_sample(sample_seed, robot=robot)
    return texts
