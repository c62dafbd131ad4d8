"""`project.toml` and an iteration's `config.toml`: one section a stage, every key with its default."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from schemas.base import Frozen
from schemas.described import Described
from schemas.estimate import EstimateSettings

LONGEST_STEP_S = 0.01
"""[s] no stage takes a longer step of the engine."""
EngineStep = Annotated[float, Field(strict=True, gt=0, le=LONGEST_STEP_S)]


class ImportSettings(Described):
    """Settings of `import`."""

    rod_length_tolerance: Annotated[float, Field(strict=True, gt=0, lt=0.5)] = 0.05
    """Largest relative departure of the fitted rod length from robot.toml; beyond it is another robot or unit."""


class CalibrateSettings(Described):
    """Settings of `calibrate`."""

    swap_threshold_m: Annotated[float, Field(strict=True, gt=0, le=1)] = 0.05
    """A recalibration that moves a length by more than this is reported as a swapped sensor."""


class RecordSettings(Described):
    """Settings of `record`."""

    rest_s: Annotated[float, Field(strict=True, ge=0, le=600)] = 2.0
    """How long the robot is held in its rest shape (all cables long), before and after every run [s]."""
    time_limit_s: Annotated[float, Field(strict=True, gt=0, le=86400)] = 3600.0
    """Longest run [s]; beyond it the robot is stopped."""
    color: Literal["jpeg", "png"] = "jpeg"
    """How colour is kept: JPEG of jpeg_quality, or PNG, which loses nothing and takes twice the room. Depth is always PNG."""
    jpeg_quality: Annotated[int, Field(strict=True, ge=50, le=100)] = 95
    """Quality of the JPEG colour."""
    camera_hold_s: Annotated[float, Field(strict=True, gt=0, le=60)] = 0.15
    """While the camera gives no frame for longer than this [s] the motors are held. More than two frames take: a larger one
    for cameras of less than 15 Hz."""
    camera_gone_s: Annotated[float, Field(strict=True, gt=0, le=60)] = 2.0
    """A camera without a frame for longer than this [s] stops the robot."""


class SimulateSettings(Described):
    """Settings of `simulate`."""

    step_s: EngineStep = 0.001
    """Step of the engine [s]; must divide the controller's period. Where cables are stiff it is divided further."""
    frame_rate_hz: Annotated[float, Field(strict=True, gt=0, le=1000)] = 50.0
    """Stored frames a second; at most one a control tick is kept."""
    tail_s: Annotated[float, Field(strict=True, ge=0, le=600)] = 0.0
    """What is simulated after the last target, motors off [s]."""
    rod_contact: Annotated[bool, Field(strict=True)] = True
    """Whether rods collide with each other."""


class IdentifySettings(Described):
    """Settings of `identify`. What each does to a fit: docs/guides/identify.md."""

    step_s: EngineStep = 0.001
    """Step of the engine [s]; must divide the controller's period. Where cables are stiff it is divided further."""
    rod_contact: Annotated[bool, Field(strict=True)] = True
    """Whether rods collide with each other."""
    free: tuple[Annotated[str, Field(min_length=1)], ...] = ()
    """Free parameters, as after --free; empty: the default set of the method."""
    fix: tuple[Annotated[str, Field(min_length=1)], ...] = ()
    """Parameters that are given a value and not fitted, as after --fix: NAME=VALUE."""
    train_share: Annotated[float, Field(strict=True, gt=0, le=1)] = 0.65
    """Share of the target intervals of each run, from its beginning, that is trained on where --train is not given."""
    window: Annotated[int, Field(strict=True, ge=1, le=100)] = 12
    """Most target intervals of a training window, simulated from one start state; tip-overs end a window as well."""
    max_iterations: Annotated[int, Field(strict=True, ge=1, le=10_000)] = 14
    """Iterations of one start on one horizon; of method paper, steps of Adam."""
    starts: Annotated[int, Field(strict=True, ge=1, le=1000)] = 3
    """Fits from different starts: the first from robot.toml, the others drawn from the priors."""
    profiles: Annotated[int, Field(strict=True, ge=0, le=100)] = 3
    """Weakest parameters whose profile likelihood is drawn."""
    self_test_cases: Annotated[int, Field(strict=True, ge=1, le=1000)] = 20
    """Planted robots of --self-test."""


class PlanSettings(Described):
    """Settings of `plan`. What each does: docs/guides/plan.md."""

    step_s: EngineStep = 0.001
    """Step of the engine [s]; must divide the controller's period. Where cables are stiff it is divided further."""
    rod_contact: Annotated[bool, Field(strict=True)] = True
    """Whether rods collide with each other."""
    depth: Annotated[int, Field(strict=True, ge=2, le=6)] = 4
    """Target shapes of a gait, the return to rest included."""
    beam: Annotated[int, Field(strict=True, ge=0)] = 200
    """Classes of like poses that go on from one level of the search to the next; 0: all."""
    merge_m: Annotated[float, Field(strict=True, ge=0, le=0.1)] = 0.006
    """Poses nearer than this [m] after a symmetry and a motion over the ground are one class; 0: every pose is its own."""
    most_changed: Annotated[int, Field(strict=True, ge=1, le=24)] = 6
    """Cables that one step may switch at most."""
    rest_error_m: Annotated[float, Field(strict=True, gt=0, le=1)] = 0.03
    """A gait that ends farther than this [m, root mean square of the caps] from the rest pose did not come back."""
    draws: Annotated[int, Field(strict=True, ge=1, le=1000)] = 8
    """Draws of the simulator's numbers that a gait is judged on; the first has the best values."""
    starts: Annotated[int, Field(strict=True, ge=1, le=1000)] = 2
    """Start poses for each draw, rest lengths anywhere in the tolerance of the controller; as many again after a gait."""
    sensor_sd_m: Annotated[float, Field(strict=True, ge=0, le=0.1)] = 0.004
    """Error of the length sensors [m], one standard deviation, drawn for every cable and draw but the first."""
    doubt: Annotated[float, Field(strict=True, ge=0, le=1)] = 0.2
    """Least standard deviation of a drawn number, as a share of that of its prior: an identification tells what noise
    leaves open, and a simulator errs by more."""
    candidates: Annotated[int, Field(strict=True, ge=1, le=10_000)] = 60
    """Gaits of each behaviour that are judged on a few draws; a third of them is judged on all."""
    kept: Annotated[int, Field(strict=True, ge=1, le=1000)] = 10
    """Gaits of each behaviour that are kept."""
    spread: Annotated[float, Field(strict=True, ge=0, le=10)] = 1.0
    """Standard deviations that are taken off the mean reward."""
    cycles: Annotated[int, Field(strict=True, ge=1, le=100)] = 6
    """Gaits of each long policy."""
    reach_m: Annotated[float, Field(strict=True, ge=0)] = 0.0
    """How far a long policy may take the robot from its start [m]; 0: as far as the camera of the last estimate sees it
    when it starts in the middle of the picture, and anywhere where no camera saw it."""
    smooth: Annotated[bool, Field(strict=True)] = True
    """Whether returns to rest between gaits are left out where a shortcut leads to the same end."""
    goal_within_m: Annotated[float, Field(strict=True, gt=0, le=10)] = 0.1
    """How near to a goal of --to is near enough [m]."""
    goal_within_deg: Annotated[float, Field(strict=True, gt=0, le=180)] = 20.0
    """And its heading [deg]."""


class DiagnoseSettings(Described):
    """Settings of `diagnose`. What each does: docs/guides/diagnose.md."""

    step_s: EngineStep = 0.002
    """Step of the engine [s]. Where cables are stiff it is divided further."""
    members: Annotated[int, Field(strict=True, ge=16, le=1024)] = 16
    """Members of the ensemble that finds where every target interval starts."""


class RunConfig(Frozen):
    """The settings of every stage; a stage stores its own section in what it writes."""

    # Not made by validation, which would build the models whenever a command starts: the defaults are valid, a test says.
    imports: ImportSettings = Field(default=ImportSettings.model_construct(), alias="import")
    calibrate: CalibrateSettings = CalibrateSettings.model_construct()
    record: RecordSettings = RecordSettings.model_construct()
    estimate: EstimateSettings = EstimateSettings.model_construct()
    simulate: SimulateSettings = SimulateSettings.model_construct()
    identify: IdentifySettings = IdentifySettings.model_construct()
    plan: PlanSettings = PlanSettings.model_construct()
    diagnose: DiagnoseSettings = DiagnoseSettings.model_construct()


class LinkSettings(Described):
    """Where the robot is, for the commands that move it: what `--port` and `--protocol` say goes before it."""

    port: str = ""
    """The robot's /dev/ttyUSB0, socket://HOST:PORT or udp://HOST:PORT; empty: --port names it every time."""
    protocol: Literal["checked", "boards", "legacy"] = "checked"
    """How it talks: checked is that of the virtual robot, legacy and boards are those of the authors' robots."""


class ProjectFile(RunConfig):
    """`project.toml`."""

    schema_version: Literal[1]
    name: Annotated[str, Field(min_length=1)]
    robot: str = "robot.toml"
    """Path of the robot description, relative to the project."""
    link: LinkSettings = LinkSettings.model_construct()
