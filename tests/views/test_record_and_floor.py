"""Pages and tables of recordings and floors: every number with its unit, what is not known said so, nothing hidden."""

from __future__ import annotations

import re

import numpy as np

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.stages.floor import Numerics, floor
from r2s2r_cli.views.floor import draw_floor, floor_page, floor_tables, repeats_drawn
from r2s2r_cli.views.record_page import plan_table, record_page, report_tables
from schemas.results_floor import CapFloor, FloorReport
from schemas.results_record import CameraCounts, RecordReport, RecordRun
from tests.support.builders import floor as built_floor, png, robot

RUN = RecordRun(
    run="walk-1", policy="walk", repeat=1, ended="the port is gone", targets=10, targets_done=3, duration_s=12.3,
    ticks=600, rate_hz=49.7, late=4, samples=1800, corrupt=7, gap_max_s=0.061, latency_median_s=0.0011,
    clock_drift=-19e-6, voltage_first_v=7.41, voltage_last_v=7.32, warnings=("ended at target 4 of 10",),
    camera=CameraCounts(frames=370, lost=2, rate_hz=30.0),
)  # fmt: skip
REPORT = RecordReport(
    port="/dev/pts/7", protocol="boards", stops_by_itself=False, clock="host", runs=(RUN,), not_begun=("walk-2",)
)


def test_the_page_of_a_recording_hides_nothing() -> None:
    """How it ended, what was not begun, that the robot does not stop by itself; a picture; no link to the web."""
    page = record_page(REPORT, {"walk-1": png(3)}).decode()
    for text in ("the port is gone", "not begun: walk-2", "does not stop by itself", "3 of 10", "ended at target 4"):
        assert text in page, text
    assert "data:image/png;base64," in page and not re.search(r'(src|href)="http', page)


def test_what_the_protocol_cannot_tell_is_a_question_mark() -> None:
    """Lost lines of a protocol without numbers are not 0."""
    went, link = report_tables(REPORT)
    row = dict(zip(link.columns, link.rows[0], strict=True))
    assert row["lost"] == row["repeated"] == "?" and row["corrupt"] == "7"
    assert row["longest gap [ms]"] == "61" and row["latency [ms]"] == "1.1" and row["clock drift [ppm]"] == "-19"
    assert dict(zip(went.columns, went.rows[0], strict=True))["battery [V]"] == "7.41 to 7.32"


def test_the_longest_a_run_can_take_is_said_before() -> None:
    """Two targets of 3 s and of the robot's 6 s, 1 s hold, twice; rest of 2 s with time-outs before and after."""
    from r2s2r_cli.stages.record import RunPlan
    from schemas.policy import PolicyFile

    steps = [{"target": (1.0,) * 6, "timeout_s": 3.0}, {"target": (0.0,) * 6, "hold_s": 1.0}]
    policy = PolicyFile.model_validate(
        {"schema_version": 1, "robot": "threebar", "name": "p", "repeat": 2, "steps": steps}
    )
    table = plan_table([RunPlan("p", policy, 1, 2.0)], robot())
    assert table.rows[0][:3] == ("p", "4", f"{2 * (3 + 6 + 1) + 2 * (2 + 6)}")


def test_the_floor_is_drawn_whatever_parts_it_has() -> None:
    """All three parts, and each alone, give a picture."""
    data = built_floor()
    for names in (("caps", "lengths", "numerics"), ("caps",), ("lengths",), ("numerics",)):
        part = ArtifactData("floor", {name: data.groups[name] for name in names})
        assert draw_floor(part).startswith(b"\x89PNG")


def test_a_floor_says_how_its_counts_go_together() -> None:
    """8 intervals in 3 phases are 5 comparisons: beside the warning that there are few of them."""
    caps = CapFloor(floor_m=0.004, sensor_m=0.001, repeatability_m=0.0039, contrasts=5, phases=3, repeats=8, basis="b")
    (table,) = floor_tables(FloorReport.model_construct(runs=(), caps=caps, lengths=None, numerics=None))
    told = "8 intervals in 3 phases, so 5 comparisons (in each phase one fewer than its intervals): b"
    assert dict(table.rows)["from"] == told


def test_the_page_of_a_floor_says_its_numbers() -> None:
    """Numerics of 3 and 4 mm: 3.54 mm in root mean square, with the way of the caps beside it."""
    numerics = Numerics(np.arange(2), np.array([0.003, 0.004]), np.array([0.03, 0.05]), 2.5e-4, 2.5e-4)
    data, report = floor([], [], policies={}, numerics=numerics)
    (table,) = floor_tables(report)
    assert dict(table.rows)["floor"].startswith("3.54 mm") and dict(table.rows)["the caps move"].startswith("40 mm")
    page = floor_page(report, draw_floor(data)).decode()
    assert "numerics 3.54 mm" in page and "no floor of the end caps" in page


def test_repeats_are_drawn_as_far_off_as_the_floor_says() -> None:
    """Two of one phase do not hide each other, and the mean square of all, each phase counted by its contrasts, is the
    square of the floor."""
    rng = np.random.default_rng(0)
    sizes = [2, 2, 3, 5]
    phase = np.repeat(np.arange(4), sizes)
    drawn = [rng.standard_normal(n) for n in sizes]
    deviation = np.concatenate([np.abs(one - one.mean()) for one in drawn])
    x, off = repeats_drawn(phase, deviation)
    assert len(np.unique(x)) == len(x)
    assert np.round(x).tolist() == (phase + 1).tolist()
    weight = np.concatenate([np.full(n, (n - 1) / n) for n in sizes])
    floor2 = sum(np.sum((one - one.mean()) ** 2) for one in drawn) / sum(n - 1 for n in sizes)
    assert np.isclose(np.sum(weight * off**2) / weight.sum(), floor2)
