"""What the default fit does where nobody says otherwise: free parameters, windows, noise, starts."""

from __future__ import annotations

from dataclasses import dataclass, field

from r2s2r_cli.stages.identify.belief import Filter
from r2s2r_cli.stages.identify.offsets import StartSpread
from schemas.config import IdentifySettings
from schemas.robot import Robot

PAPER_FREE = ("motor_speed", "friction")
"""The two parameters of the paper."""


@dataclass(frozen=True)
class Recipe:
    """How a fit is made, in rounds.

    The first round: windows of at most `window` intervals, whose start states are free within `spread`, growing. It
    comes near from afar: a long free run says more about speeds than anything else. Then `filtered` rounds: windows of
    each length in `short`, from every interval on, that start where the filter says with the parameters of the round
    before, as test intervals will; these start states are not free, and the parameters learn to predict from them.

    noise [m]: see CapResiduals. key_only: compare key frames only. max_iterations: of the last horizon of the first
    round; cooled_generations: of the population of each later one. loss: name in solve.LOSSES. belief: of the filter.
    step [s]: of the engine. held: free parameters that stay at their starts, since the training intervals do not show
    them.
    """

    window: int = 12
    filtered: int = 2
    short: tuple[int, ...] = (2, 3, 4)
    noise: float = 4e-3
    key_only: bool = False
    max_iterations: int = 14
    cooled_generations: int = 10
    loss: str = "student_t"
    belief: Filter = field(default_factory=Filter)
    spread: StartSpread = field(default_factory=StartSpread)
    step: float = 1e-3
    held: tuple[str, ...] = ()

    def horizons(self, longest: int) -> tuple[int, ...]:
        """Intervals that the stages of a growing fit cover, for windows of at most `longest`: 1, 2, 4 ... all."""
        found = [1]
        while 2 * found[-1] < longest:
            found.append(2 * found[-1])
        return tuple(found) if found[-1] >= longest else (*found, longest)


def recipe_of(settings: IdentifySettings) -> Recipe:
    """The recipe with the settings of a project."""
    return Recipe(window=settings.window, max_iterations=settings.max_iterations, step=settings.step_s)


WINCH_DAMPING = 40.0
"""[N s/m] Geared winches do not follow a pull. Ten times what robot.toml assumes: on the real crawl the damping,
free, runs up to its bound of 80, and with 40 held-out parts are predicted better than with 4 (identification.md). On
the rig, whose cables have 4, the cost is a third lower with 40: stiff cables with little damping make it rough."""


def default_free(robot: Robot, moved: tuple[tuple[str, int], ...]) -> tuple[str, ...]:
    """Specs of the parameters that are free where nobody says so: 12 on the 3-bar robot in its crawl.

    moved: (way, cable), in or out, of the winches that the commands turn. Winding and unwinding rates of those that do
    most, friction, the mass of the last rod, the rest lengths of the passive tendons, and the delay between a logged
    command and the motion that is seen. Priors are wide where nobody has measured.

    One mass: rods carry electronics and batteries unequally, and where the centre of mass is decides which caps slip.
    A second one says the same in a crawl, and the weight as a whole only scales forces.
    """
    speeds = [f"motor_speed_{way}.{cable},~0.2" for way, cable in moved]
    passive = [f"rest_length.{k},~0.02" for k, cable in enumerate(robot.cables) if cable.kind == "passive"]
    mass = f"mass.{len(robot.rods) - 1},~0.15"
    return (*speeds, "friction,~0.3", mass, *passive, "command_delay=0.1,0..0.5,~0.1")


def default_fixed(robot: Robot) -> dict[str, float]:
    """Values, by parameter, that the default set of free parameters goes with: what winches give way."""
    return {"damping_actuated": WINCH_DAMPING} if robot.actuated else {}
