"""Trajectory CSV + TOML sidecar -> one run of a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from r2s2r_cli.artifact import Group, Scalar
from r2s2r_cli.control_sign import WRONG_SIGN, cable_response
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages import frames
from r2s2r_cli.stages.import_.checks import ROD_TOLERANCE, UNITS, check_handedness, check_rod_length, check_up_axis
from r2s2r_cli.stages.import_.clock import check_stamps, few_frames
from r2s2r_cli.stages.import_.columns import Columns, find_columns
from r2s2r_cli.stages.import_.missing import missing_commands, unseen_targets
from r2s2r_cli.stages.import_.run import (
    NO_NATURE,
    cap_noise,
    check_clock,
    dropped_frames,
    finite_attributes,
    stream_sizes,
    time_facts,
)
from r2s2r_cli.stages.import_.sidecar import check_sidecar, run_attributes
from r2s2r_cli.stages.import_.table import Table, read_table
from r2s2r_cli.stages.segments import hidden_targets, segments, target_intervals
from schemas.results_import import ImportReport
from schemas.robot import Robot
from schemas.sidecar import Sidecar

MAX_COORDINATE_M = 1000.0
"""Farther from its origin no camera or motion capture sees a robot: a broken cell."""
MAX_STAMP_S = 1e11
"""Unix seconds are 1.7e9; milliseconds since 1970 are above this."""
_EPS = 1e-6
"""Rounding of a logged position or control."""


def import_trajectory(
    data: bytes,
    name: str,
    *,
    robot: Robot,
    sidecar: Sidecar,
    where: str,
    rod_length_tolerance: float = ROD_TOLERANCE,
    known_rods: Mapping[str, Sequence[float]] | None = None,
) -> tuple[dict[str, Group], ImportReport]:
    """Groups of one run by stream (the run itself under ''), and the report.

    data: bytes of the CSV; `where` names it in messages. Every row is stored, with the reason why it is left out
    of everything later; cap positions are in metres, world frame as in the file. known_rods: rod lengths [m] of
    other robots, named in the message when this one's do not fit. Raises InputError for anything that cannot be
    read exactly as it stands: nothing is converted but the unit that the column names state.
    """
    check_sidecar(sidecar, robot, where, known_rods or ())
    table = read_table(data, where)
    columns = find_columns(table, robot)
    check_stamps(table.values[:, columns.t], where)
    _check_cells(table, columns)
    values = table.values
    scale = UNITS[columns.unit]
    t = values[:, columns.t]
    p_WE = values[:, columns.caps] * scale
    target = values[:, columns.target]
    control = None if columns.control is None else values[:, columns.control]

    reason = frames.keep_frames(t, p_WE)
    warnings = check_clock(t, reason, where)
    kept = reason == frames.KEPT
    t = t - t[kept][0]
    t_kept, p_kept = t[kept], p_WE[kept]
    radius = np.repeat([rod.cap_radius_m for rod in robot.rods], 2)
    warnings += check_rod_length(
        p_kept, robot, where=where, unit=columns.unit, tolerance=rod_length_tolerance, known_rods=known_rods
    )
    warnings += check_up_axis(p_kept, radius, where)
    check_handedness(p_kept, robot, where)

    attributes = run_attributes(sidecar, robot, "trajectory_csv")
    commands = _commands(t, reason, target, control)
    hidden = hidden_targets(t_kept, commands["t"], commands["target"])
    intervals = target_intervals(
        t_kept,
        target[kept],
        control=None if control is None else control[kept],
        position=_cable_position(p_kept, robot, attributes),
        tolerance=float(attributes.get("pid_tolerance", 0.0)),
        hidden=hidden,
    )
    cuts = segments(intervals, t_kept, None if control is None else control[kept])
    sd, noise = cap_noise(t_kept, p_kept)
    rod_length, rod_sd = frames.fit_rod_length(p_kept)
    offset = frames.ground_offset(p_kept, radius)
    facts = time_facts(t_kept)
    groups = {
        "": Group(attributes=attributes),
        "caps": Group(
            datasets={
                "t": t,
                "p_WE": p_WE,
                "drop_reason": reason,
                "source_row": table.line,
                "noise_sd": sd,
                "rod_length": rod_length,
                "rod_length_sd": rod_sd,
            },
            attributes=finite_attributes(
                ground_offset=offset,
                stamp_jitter=frames.stamp_jitter(t_kept),
                noise_sd_stated=sidecar.noise_sd_m,
            ),
        ),
        "commands": commands,
        "intervals": intervals.to_group(),
        "segments": cuts.to_group(),
    }
    if len(columns.length):
        rows = frames.in_order(t, reason)
        groups["sensors"] = Group(
            datasets={
                "t": t[rows],
                "length": values[rows][:, columns.length] * scale,
                "cable": columns.length_cable,
            }
        )
    if noise is not None and noise.held:
        warnings.append(f"far quieter than the rest, as if the source held them: {', '.join(noise.held)}")
    warnings += few_frames(len(t_kept), dropped_frames(reason)) + _check_control(
        groups["commands"], t_kept, p_kept, robot
    )
    warnings += missing_commands(table, columns, reason, len(intervals)) + unseen_targets(t_kept, hidden)
    if sidecar.nature is None:
        warnings.append(NO_NATURE)
    if len(intervals) and not intervals.complete[-1]:
        warnings.append(f"target interval {len(intervals)} is cut off before it has moved to its end: marked")
    report = ImportReport(
        run=name,
        format="trajectory_csv",
        robot=robot.name,
        nature=str(attributes["nature"]),
        source=sidecar.source,
        unit=columns.unit,
        rows=len(t),
        kept=int(kept.sum()),
        dropped=dropped_frames(reason),
        intervals=len(intervals),
        intervals_complete=int(intervals.complete.sum()),
        segments=len(cuts),
        noise=noise,
        noise_sd_stated_m=sidecar.noise_sd_m,
        rod_length_m=tuple(rod_length.tolist()),
        rod_length_sd_m=tuple(rod_sd.tolist()),
        rod_length_robot_m=tuple(rod.length_m for rod in robot.rods),
        ground_offset_m=offset,
        streams=stream_sizes(groups),
        warnings=tuple(warnings),
        duration_s=facts.duration,
        frame_gap_median_s=facts.gap_median,
        stamp_jitter_s=facts.jitter,
        gaps=facts.gaps,
    )
    return groups, report


def _check_cells(table: Table, columns: Columns) -> None:
    """Refuse numbers that no run can hold, with the place of the first one."""
    far = MAX_COORDINATE_M / UNITS[columns.unit]
    control = np.array([], dtype=int) if columns.control is None else columns.control
    rules = (
        ([columns.t], -MAX_STAMP_S, MAX_STAMP_S, "a stamp in seconds", "write t_s in seconds"),
        (
            columns.caps.ravel(),
            -far,
            far,
            f"within {MAX_COORDINATE_M:g} m of the origin",
            "write nan where it was lost",
        ),
        (columns.target, -_EPS, 1 + _EPS, "a cable position: 0 short .. 1 long", "divide percentages by 100"),
        (control, -1 - _EPS, 1 + _EPS, "a motor command over its maximum: -1 .. 1", "divide it by the maximum speed"),
        (columns.length, -far, far, f"below {MAX_COORDINATE_M:g} m", "write nan where it was not received"),
    )
    for selected, low, high, expected, hint in rules:
        part = table.values[:, np.asarray(selected, dtype=int)]
        bad = np.argwhere((part < low) | (part > high))
        if len(bad):
            row, column = int(bad[0, 0]), int(np.asarray(selected)[bad[0, 1]])
            raise InputError(
                "a cell is out of range",
                where=table.place(row, column),
                expected=expected,
                received=f"{table.values[row, column]:g}",
                hint=hint,
            )
    unstamped = np.flatnonzero(np.isnan(table.values[:, columns.t]))
    if len(unstamped):
        raise InputError(
            "a row has no stamp",
            where=table.place(int(unstamped[0]), columns.t),
            expected="seconds",
            received="nan",
            hint="take the row out: without its time it says nothing",
        )


def _commands(t: np.ndarray, reason: np.ndarray, target: np.ndarray, control: np.ndarray | None) -> Group:
    rows = frames.in_order(t, reason)
    datasets = {"t": t[rows], "target": target[rows]}
    if control is not None:
        datasets["control"] = control[rows]
    return Group(datasets=datasets)


def _check_control(commands: Group, t: np.ndarray, p_WE: np.ndarray, robot: Robot) -> list[str]:
    """The warning about commands that lengthen their cables: all signs exchanged."""
    if "control" not in commands.datasets:
        return []
    response = cable_response(t, cap_distances(p_WE, robot), commands["t"], commands["control"])
    if not response < WRONG_SIGN:
        return []
    text = (
        f"control > 0 lengthens the cables (correlation {response:.2f}): +1 must reel in, so the signs of the control "
        "columns are wrong; negate them and import again"
    )
    return [text]


def cap_distances(p_WE: np.ndarray, robot: Robot) -> np.ndarray:
    """Distance of the two caps of each actuated cable [m], shape (frame, actuated)."""
    ends = np.array([robot.cables[k].caps for k in robot.actuated], dtype=int).reshape(-1, 2)
    return np.linalg.norm(p_WE[:, ends[:, 0]] - p_WE[:, ends[:, 1]], axis=-1)


def _cable_position(p_WE: np.ndarray, robot: Robot, attributes: Mapping[str, Scalar]) -> np.ndarray | None:
    """Position of the actuated cables from the distance of their caps, shape (frame, actuated).

    (distance - min_length) / range, as the controller computes it from its sensors; None where the sidecar does
    not give the controller. The distance of the caps is not the length of the cable between its attachment sites:
    good enough to compare the ends of intervals of the same target, which is all it is used for.
    """
    if "pid_min_length" not in attributes or "pid_range" not in attributes:
        return None
    return (cap_distances(p_WE, robot) - float(attributes["pid_min_length"])) / float(attributes["pid_range"])
