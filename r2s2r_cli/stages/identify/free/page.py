"""The page docs/reference/free-parameters.md, from the catalogue itself."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence

from r2s2r_cli.stages.identify.free.base import Coordinate
from r2s2r_cli.stages.identify.free.catalogue import own_entries
from r2s2r_cli.stages.identify.free.entry import INSIDE, Entry
from r2s2r_cli.stages.identify.free.surroundings import RESTITUTION_SCALE
from r2s2r_cli.stages.init.robots import robot_toml
from schemas.robot import Robot

_HEAD = """\
# Free parameters

What `r2s2r identify --free SPEC` can fit, here for the three-bar robot of `r2s2r init`; another robot has as many
elements as it has parts. Each SPEC names one parameter; give the option again for the next.

    SPEC = NAME[=START][,LOWER..UPPER][,~SD]

- `NAME`: from the tables below, or `FAMILY.*` for every element of a family (`motor_speed.*`).
- `START`: where the fit begins, and the mean of the prior. Default: the number of `robot.toml`.
- `LOWER..UPPER`: bounds; either end may be left out (`..2`).
- `~SD`: standard deviation of the prior; `~inf` for none. In the unit of the parameter where its coordinate is linear,
  relative where it is log (`~0.1`: 10 %), in the coordinate ln((x - lower) / (upper - x)) where it is logit.

```console
r2s2r identify --free friction --free "motor_speed=0.5,0.2..1,~0.3" --free "rest_length.*,~0.005"
```

Rules:

- One number for many elements goes with each of them in proportion, and what is shown is their mean: `motor_speed`
  0.4 where robot.toml has 0.8 for all winches halves all speeds. `rest_length` moves all passive cables by the same
  length instead.
- Two parameters that set the same number contradict each other (`motor_speed` and `motor_speed.2`, the effect
  `motor_lag.tau_s` and `motor_lag`): exit code 2. A part may be free while the whole is fixed: `--fix motor_speed=0.6
  --free motor_speed.2`.
- No fit starts on a bound. Where the number of robot.toml lies on one (restitution 0, a lag of 0, an effect that is
  off), the start is {inside:g} of the prior's scale inside; for restitution that is {bounce:g}. A START that lies on a
  bound or outside, or bounds the wrong way round: exit code 4.
- Numbers of the controller act in closed loop only; those of the log lie between the robot and what was logged.
- Elements are numbered as in robot.toml: K a cable (also for its winch), R a rod, capK an end cap.
"""

_EFFECTS = """\
## Effects

Every number of every effect in `r2s2r_cli/effects` as well: `EFFECT.PARAMETER` (`motor_lag.tau_s`), and one number an
element where it has elements (`cap_friction.factor.3` for cap 3; `cap_friction.factor` is one number for all caps).
Bounds and the prior's scale are those of the effect, the coordinate is linear, and the fit starts at the effect's off
value; beside it where that is a bound, or other numbers would do nothing there (`friction_anisotropy.ratio`,
`friction_field.patch_factor`). The prior is about the off value, and there a number is held that the training intervals
do not show; both are at START where you give one. A free number of an effect puts the effect into the simulator.
"""
_TITLES = {"robot": "Robot and ground", "log": "Log", "controller": "Controller"}


def free_parameters_page() -> str:
    """The whole page but for the note that it is generated."""
    robot = Robot.model_validate(tomllib.loads(robot_toml("threebar")))
    grouped: dict[str, list[list[Entry]]] = {name: [] for name in _TITLES}
    for entry in own_entries(robot).values():
        rows = grouped[_group(entry)]
        one_row = rows and entry.element is not None and _row_name(rows[-1][0]) == _row_name(entry)
        if one_row:
            rows[-1].append(entry)
        else:
            rows.append([entry])
    tables = "\n".join(f"## {_TITLES[name]}\n\n{_table(rows)}" for name, rows in grouped.items())
    return f"{_HEAD.format(inside=INSIDE, bounce=INSIDE * RESTITUTION_SCALE)}\n{tables}\n{_EFFECTS}"


def _group(entry: Entry) -> str:
    of = getattr(entry.action, "of", "robot")
    return {"observation": "log", "pid": "controller"}.get(of, "robot")


def _row_name(entry: Entry) -> str:
    """The name with a letter for the element: motor_speed.K, friction.capK, mass.R."""
    if entry.element is None:
        return entry.free.name
    letter = "R" if entry.family in ("mass", "com", "attachment_phase") else "K"
    return entry.free.name.removesuffix(str(entry.element)) + letter


def _table(rows: Sequence[list[Entry]]) -> str:
    lines = ["| name | unit | robot.toml | bounds | coordinate | prior sd | what |",
             "| --- | --- | --- | --- | --- | --- | --- |"]  # fmt: skip
    for row in rows:
        free = row[0].free
        bounds = _of_all([f"{one.free.lower:.4g} to {one.free.upper:.4g}" for one in row])
        sd = f"{free.prior_sd:g}" + (" relative" if free.coordinate is Coordinate.LOG else "")
        what = free.what
        if row[0].element is not None:
            before, _, after = what.rpartition(f" {row[0].element}")
            what = f"{before} {_row_name(row[0])[-1]}{after}"
        lines.append(
            f"| `{_row_name(row[0])}` | {free.unit} | {_of_all([f'{one.nominal:.4g}' for one in row])} | {bounds} "
            f"| {free.coordinate} | {sd} | {what} |"
        )
    return "\n".join(lines) + "\n"


def _of_all(texts: Sequence[str]) -> str:
    """The text that all elements have, or that each has its own."""
    return texts[0] if len(set(texts)) == 1 else "each its own"
