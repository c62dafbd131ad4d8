"""`project.toml` and an iteration's `config.toml`: one section a stage, every key with its default."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import ConfigDict, Field

from schemas.base import Frozen
from schemas.estimate import EstimateSettings


class ImportSettings(Frozen):
    """Settings of `import`."""

    model_config = ConfigDict(use_attribute_docstrings=True)

    rod_length_tolerance: Annotated[float, Field(strict=True, gt=0, lt=0.5)] = 0.05
    """Largest relative departure of the fitted rod length from robot.toml; beyond it is another robot or unit."""


class CalibrateSettings(Frozen):
    """Settings of `calibrate`."""

    model_config = ConfigDict(use_attribute_docstrings=True)

    swap_threshold_m: Annotated[float, Field(strict=True, gt=0, le=1)] = 0.05
    """A recalibration that moves a length by more than this is reported as a swapped sensor."""


class RunConfig(Frozen):
    """The settings of every stage; a stage stores its own section in what it writes."""

    imports: ImportSettings = Field(default=ImportSettings(), alias="import")
    calibrate: CalibrateSettings = CalibrateSettings()
    estimate: EstimateSettings = EstimateSettings()


class ProjectFile(RunConfig):
    """`project.toml`."""

    schema_version: Literal[1]
    name: Annotated[str, Field(min_length=1)]
    robot: str = "robot.toml"
    """Path of the robot description, relative to the project."""
