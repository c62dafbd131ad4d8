"""What only a run of camera images has, as groups of `schemas/estimate.py`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.artifact import Group, Scalar

if TYPE_CHECKING:
    from r2s2r_cli.stages.estimate.camera_run import CameraFacts


def camera_groups(facts: CameraFacts, shift: float) -> dict[str, Group]:
    """Groups by name. shift: by which the world was moved up after tracking [m]."""
    made = {"camera": _camera(facts), "sightings": _sightings(facts, shift)}
    if facts.readings is not None:
        made["sensor_fit"] = _sensor_fit(facts)
    return made


def _camera(facts: CameraFacts) -> Group:
    lens, swept, ground = facts.lens, facts.swept, facts.survey.ground
    attributes: dict[str, Scalar] = {
        "width": lens.width, "height": lens.height, "fx": lens.fx, "fy": lens.fy, "cx": lens.cx, "cy": lens.cy,
        "depth_scale": facts.depth_scale, "begun": swept.first, "searched": int(np.sum(swept.searched)),
    }  # fmt: skip
    if ground is not None:
        attributes |= {"plane_share": ground.share, "plane_noise": ground.noise_sd}
    return Group(
        {
            "X_WC": facts.X_WC,
            "shift_px": np.asarray(facts.survey.shift_px, dtype=float),
            "noise_scale": np.asarray(facts.tracked.noise_scale, dtype=float),
        },
        attributes,
    )


def _sightings(facts: CameraFacts, shift: float) -> Group:
    swept = facts.swept
    seen = np.isfinite(swept.sighted.p_WE[..., 0])
    return Group({
        "p_WE": swept.sighted.p_WE + np.array([0.0, 0.0, shift]),
        "cov_p_WE": np.where(seen[..., None, None], swept.sighted.cov, np.nan),
        "visible": swept.visible, "code": swept.code, "residual": facts.residual,
    })  # fmt: skip


def _sensor_fit(facts: CameraFacts) -> Group:
    tracked = facts.tracked
    clock = tracked.clock
    attributes: dict[str, Scalar] = {"delay": float(clock.delay_s) if clock.known else 0.0, "delay_known": clock.known}
    if clock.known:
        attributes["delay_sd"] = float(clock.sd_s)
    return Group(
        {"bias": tracked.sensor_bias, "bias_sd": tracked.sensor_bias_sd, "noise_sd": tracked.sensor_noise_sd,
         "dead": tracked.sensor_dead},
        attributes,
    )  # fmt: skip
