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


class SimulateSettings(Frozen):
    """Settings of `simulate`."""

    model_config = ConfigDict(use_attribute_docstrings=True)

    step_s: Annotated[float, Field(strict=True, gt=0, le=0.01)] = 0.001
    """Step of the engine [s]; must divide the controller's period. Where cables are stiff it is divided further."""
    frame_rate_hz: Annotated[float, Field(strict=True, gt=0, le=1000)] = 50.0
    """Stored frames a second; at most one a control tick is kept."""
    tail_s: Annotated[float, Field(strict=True, ge=0, le=600)] = 0.0
    """What is simulated after the last target, motors off [s]."""
    rod_contact: Annotated[bool, Field(strict=True)] = True
    """Whether rods collide with each other."""


class RunConfig(Frozen):
    """The settings of every stage; a stage stores its own section in what it writes."""

    imports: ImportSettings = Field(default=ImportSettings(), alias="import")
    calibrate: CalibrateSettings = CalibrateSettings()
    estimate: EstimateSettings = EstimateSettings()
    simulate: SimulateSettings = SimulateSettings()


class ProjectFile(RunConfig):
    """`project.toml`."""

    schema_version: Literal[1]
    name: Annotated[str, Field(min_length=1)]
    robot: str = "robot.toml"
    """Path of the robot description, relative to the project."""
