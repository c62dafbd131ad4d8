"""The checks of `validate`: one explicit list, in the order in which they are run and documented."""

from __future__ import annotations

from r2s2r_cli.checks import (
    calibrations,
    camera,
    control,
    estimates,
    files,
    geometry,
    links,
    motion,
    policies,
    robots,
    schema,
    sensors,
    simulations,
    spans,
    stamps,
)
from r2s2r_cli.checks.base import Check

CHECKS: tuple[Check, ...] = (
    files.file_opens, files.values_allowed, files.version_known, files.content_intact, files.bytes_intact,
    schema.layout_matches, schema.values_finite, schema.codes_known, schema.text_readable, schema.images_begin_right,
    links.head_matches_body, links.inputs_match, links.source_unchanged, links.robot_is_the_projects,
    links.stage_not_newer, links.name_fits_kind, links.recordings_sealed,
    stamps.time_increases, stamps.kept_frames_apart, stamps.samples_ordered, stamps.source_frames_increase,
    geometry.counts_match_robot, geometry.kept_frames_observed, geometry.rod_length_is_the_robots,
    geometry.rods_keep_their_length, geometry.cable_lengths_in_limits, geometry.caps_above_ground,
    geometry.caps_below_ceiling, geometry.caps_move_like_a_robot,
    control.targets_in_range, control.controls_in_range, control.controls_shorten_cables, control.positions_plausible,
    control.targets_constant, control.intervals_enough,
    spans.spans_ordered, spans.spans_inside_frames, spans.span_stamps_match, spans.segments_in_their_interval,
    spans.directions_known,
    sensors.sensor_chip_initialised, sensors.capacitance_in_farads, sensors.sensors_move, sensors.sensors_received,
    sensors.sensor_lengths_in_limits, sensors.sensor_cables_exist, sensors.gravity_is_seen,
    camera.depth_pairs_exist, camera.depth_pairs_close, camera.depth_scale_sensible, camera.intrinsics_sensible,
    camera.camera_pose_is_rigid,
    motion.quaternions_are_unit, motion.rods_are_rigid, motion.poses_match_caps, motion.speeds_are_sane,
    motion.contacts_near_ground, motion.lengths_match_caps,
    estimates.covariances_are_valid, estimates.deviations_are_positive, estimates.probabilities_in_range,
    estimates.ground_normal_is_unit, estimates.roll_is_not_invented, estimates.caps_well_observed,
    estimates.noise_as_assumed,
    simulations.cables_never_push, simulations.rest_lengths_positive, simulations.step_fits_frames,
    calibrations.calibration_rows_exist, calibrations.sensors_are_alive, calibrations.residuals_are_small,
    calibrations.tendons_rise, calibrations.masses_make_a_rod, calibrations.history_is_sound,
    policies.policy_robot_known, policies.policy_fits_cables, policies.policy_targets_in_range,
    policies.policy_times_sensible, policies.policy_steps_differ,
    robots.rest_pose_fits_rods, robots.rest_pose_on_ground, robots.sites_on_their_caps, robots.cables_join_other_caps,
    robots.rod_masses_plausible, robots.parts_on_their_rod, robots.winches_plausible, robots.rest_lengths_in_limits,
    robots.pid_range_in_limits, robots.sensors_are_calibrated, robots.sensor_lines_plausible,
    robots.robot_was_measured,
)  # fmt: skip

FAMILIES: dict[str, str] = {
    "files": "Can it be read",
    "schema": "Form: what the schema fixes",
    "links": "Links: to the project, the inputs, the robot",
    "stamps": "Time",
    "geometry": "End caps against the robot",
    "control": "Targets and controls",
    "spans": "Target intervals and segments",
    "sensors": "Cable sensors and IMU",
    "camera": "Camera",
    "motion": "States of the rods",
    "estimates": "Estimates",
    "simulations": "Simulated runs",
    "calibrations": "Calibrations",
    "policies": "Policies",
    "robots": "Robot descriptions",
}
"""Module of each family -> its heading; in the order of CHECKS."""
