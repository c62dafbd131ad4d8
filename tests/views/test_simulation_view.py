"""The picture of a simulated run, and the page that plays it."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData, Group
from r2s2r_cli.views.page import Page, PageTable
from r2s2r_cli.views.simulation import draw_simulation, instants
from r2s2r_cli.views.simulation_page import report_tables
from r2s2r_cli.views.simulation_playback import BYTES_MAX, kept_frames, playback_data, playback_page
from r2s2r_cli.views.simulation_scene import (
    BOTTOM,
    TOP,
    cable_line,
    depth,
    rotated,
    scene_reach,
    screen,
    tension_color,
)
from schemas.results_simulate import SimulateReport, SimulateRun
from tests.support import builders

PAGE = Page(title="Simulation of <a robot>", sentence="One run.", labels=["a </script> in a warning"],
            tables=[PageTable("runs", ["run"], [["walk"]])])  # fmt: skip
SCRIPTS = Path(__file__).resolve().parents[2] / "r2s2r_cli" / "views" / "templates"
NODE = shutil.which("node")
HARNESS = Path(__file__).with_name("player_harness.js")
needs_node = pytest.mark.skipif(NODE is None, reason="there is no node to run the player's script with")


def played(data: ArtifactData, folder: Path) -> dict[str, Any]:
    """What the player shows of a simulation when somebody plays, turns, zooms, scrubs and rewinds it."""
    assert NODE is not None
    (folder / "data.json").write_text(json.dumps(playback_data(data, builders.robot())))
    files = [folder / "data.json", SCRIPTS / "playback_scene.js", SCRIPTS / "playback_page.js", SCRIPTS / "playback.js"]
    done = subprocess.run([NODE, HARNESS, *files], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def simulation(frames: int = 40, *, slack: bool = True) -> ArtifactData:
    """The builders' run with a cable that hangs and tensions that differ."""
    data = builders.simulation(frames)
    states = dict(data.groups["runs/walk/frames"].datasets)
    tension = np.linspace(0.5, 8, frames)[:, None] * np.linspace(0.2, 1, 9)
    rest = np.array(states["rest_length"])
    if slack:
        tension[:, 4] = 0
        rest[:, 4] += 0.1
    states.update(tension=tension, rest_length=rest)
    return ArtifactData("simulation", {**data.groups, "runs/walk/frames": Group(states)})


def test_every_run_is_drawn_and_the_drawing_is_repeatable() -> None:
    """One PNG a run, the same bytes for the same values, other bytes for other ones."""
    data = simulation()
    first, second, other = (dict(draw_simulation(d, builders.robot())) for d in (data, data, simulation(slack=False)))
    assert list(first) == ["walk"]
    assert first["walk"].startswith(b"\x89PNG")
    assert first == second
    assert first != other


def test_a_run_without_commands_and_intervals_is_drawn() -> None:
    """Both are optional in a simulation, so also in its picture and its page."""
    data = simulation()
    bare = ArtifactData(
        "simulation", {k: g for k, g in data.groups.items() if not k.endswith(("ands", "vals", "ents"))}
    )
    assert "runs/walk/intervals" not in bare.groups
    assert len(dict(draw_simulation(bare, builders.robot()))["walk"]) > 10_000
    assert playback_data(bare, builders.robot())["runs"][0]["intervals"] == []


def test_instants_are_ends_of_targets_with_start_and_end() -> None:
    """Never more than asked for, first and last frame always among them, each once."""
    data = simulation()
    assert instants(data, "walk") == [0, 19, 39]
    bare = ArtifactData("simulation", {k: g for k, g in data.groups.items() if not k.endswith("intervals")})
    assert instants(bare, "walk")[0] == 0 and instants(bare, "walk")[-1] == 39 and len(instants(bare, "walk")) == 5


def test_the_view_is_a_rotation() -> None:
    """Right, up and towards the viewer are perpendicular unit directions: lengths and angles are true."""
    unit = np.eye(3)
    frame = np.column_stack([screen(unit), depth(unit)])
    assert frame.T @ frame == pytest.approx(np.eye(3), abs=1e-12)


def test_no_cap_is_cut_off() -> None:
    """What a scene must show holds every cap of a robot that is wide, and of one that stands tall."""
    wide = np.array([[[-0.5, -0.5, 0.0], [0.5, 0.5, 0.1]]])
    tall = np.array([[[0.0, 0, 0], [0, 0, 0.9]]])
    for p in (wide, tall, np.array([[[-0.1, -0.4, 0.0], [0.1, 0.4, 0.0]]])):
        reach, seen = scene_reach(p), screen(p)
        assert abs(seen[..., 0]).max() < reach
        assert seen[..., 1].max() < TOP * reach and seen[..., 1].min() > -BOTTOM * reach


def test_quaternions_turn_vectors() -> None:
    """A quarter turn about z takes x to y; xyzw."""
    q = np.array([0, 0, np.sin(np.pi / 4), np.cos(np.pi / 4)])
    assert rotated(q, np.array([1.0, 0, 0])) == pytest.approx([0, 1, 0])


def test_a_slack_cable_hangs_by_its_spare_length() -> None:
    """The drawn parabola is about as long as the cable; a taut one is straight, and none goes through the ground."""
    ends = np.array([[0, 0, 1.0], [0.2, 0, 1.0]])
    line = cable_line(ends, 0.21)
    assert np.linalg.norm(np.diff(line, axis=0), axis=-1).sum() == pytest.approx(0.21, rel=0.01)
    assert cable_line(ends, 0.0)[:, 2] == pytest.approx(1.0)
    assert cable_line(ends - [0, 0, 0.99], 0.4)[:, 2].min() == 0


def test_colours_run_from_blue_to_red() -> None:
    """The ends of the scale, and beyond them."""
    assert tension_color(-1) == tension_color(0) and tension_color(2) == tension_color(1)
    assert tension_color(0)[2] > tension_color(0)[0] and tension_color(1)[0] > tension_color(1)[2]


def test_the_page_needs_nothing_else() -> None:
    """No address, no file beside it, text escaped, one script element for the data that nothing in it can end."""
    page = playback_page(PAGE, simulation(), builders.robot()).decode()
    assert not re.search(r"https?://|<link|<img|src=|@import|fetch\(|XMLHttpRequest|import\(", page)
    assert "Simulation of &lt;a robot&gt;" in page
    assert page.count("</script>") == 2
    assert len(page) < 100_000


def test_a_long_run_stays_below_a_megabyte() -> None:
    """Half an hour at 50 Hz is thinned out; the first and last frame stay."""
    m = builders.simulation(24).groups["runs/walk/frames"]
    repeat = {name: np.concatenate([m[name]] * 1500) for name in m.datasets}
    repeat["t"] = 0.05 * np.arange(len(repeat["t"]))
    data = ArtifactData("simulation", {**builders.simulation().groups, "runs/walk/frames": Group(repeat)})
    assert len(playback_page(PAGE, data, builders.robot())) < 1_000_000
    t = np.frombuffer(base64.b64decode(playback_data(data, builders.robot())["runs"][0]["t"]), "<f4")
    assert (t[0], t[-1]) == (0, pytest.approx(repeat["t"][-1]))
    assert 8000 < len(t) < BYTES_MAX / 70


def test_frames_are_spread_evenly() -> None:
    """Thirty a second of fifty, half of them where there is room for half, all of a short run."""
    t = 0.02 * np.arange(101)
    assert len(kept_frames(t, 1.0)) == 60
    assert len(kept_frames(t, 0.25)) == 25
    assert np.diff(t[kept_frames(t, 0.25)]).max() < 0.11
    assert kept_frames(t[:3], 0.01).tolist() == [0, 2]


def test_the_report_becomes_tables() -> None:
    """Lengths in mm, angles in degrees; what is not there is a dash; only cables that are slack are named."""
    run = SimulateRun(
        run="walk", policy="walk", control="command replay", start="rest", start_shift_m=0.001, frames=3,
        duration_s=2.5, step_s=0.001, substeps=1, targets=0, timed_out=(),
        com_displacement_m=(0.1, -0.02, 0), com_path_m=0.15,
        heading_change_rad=None, penetration_max_m=2e-5, cap_height_max_m=0.21, tension_max_n=9.96, tension_max_cable=7,
        slack_share=(0.0, 0.25, 0.001),
    )  # fmt: skip
    turned = run.model_copy(update={"heading_change_rad": np.pi / 2, "targets": 4, "timed_out": (2,)})
    runs, slack = report_tables(SimulateReport(runs=(run, turned), computed_by="torch"))
    assert runs.rows[0] == [
        "walk",
        "replay",
        "rest",
        "2.50",
        "-",
        "0",
        "+100, -20",
        "150",
        "-",
        "210",
        "10.0 (7)",
        "0.02",
    ]
    assert (runs.rows[1][4], runs.rows[1][5], runs.rows[1][8]) == ("4", "1", "+90.0")
    assert len(runs.columns) == len(runs.rows[0])
    assert slack.rows[0] == ["walk", "cables 1 25%"]


@needs_node
def test_the_player_plays(tmp_path: Path) -> None:
    """It draws finite numbers, runs to the end in real time, scrubs to the middle and rewinds to the start."""
    shown = played(simulation(), tmp_path)
    times = [float(re.match(r"[\d.]+", clock)[0]) for clock in shown["clocks"]]  # type: ignore[index]
    assert times[0] == 0
    assert times[2] - times[1] == pytest.approx(0.25)
    assert max(times) == pytest.approx(3.9) and times[-2] == pytest.approx(1.95) and times[-1] == 0
    assert all(shown["drawn"][name] > 200 for name in ("scene", "panel", "timeline"))


@needs_node
def test_the_player_shows_the_stored_states(tmp_path: Path) -> None:
    """Caps within 0.1 mm, tensions within half a per cent of the strongest, slack cables and contacts exactly."""
    data = simulation(10)
    frames = data.groups["runs/walk/frames"]
    poses = played(data, tmp_path)["poses"][0]
    assert np.array([pose["caps"] for pose in poses]) == pytest.approx(frames["p_WE"], abs=1e-4)
    newton = np.array([[cable["newton"] for cable in pose["cables"]] for pose in poses])
    assert newton == pytest.approx(frames["tension"].clip(max=newton.max()), abs=0.005 * newton.max())
    assert [cable["slack"] for cable in poses[0]["cables"]] == (frames["tension"][0] == 0).tolist()
    assert [pose["contact"] for pose in poses] == frames["contact"].astype(int).tolist()
    com = np.mean(frames["p_WR"], axis=1)
    assert np.array([pose["com"] for pose in poses]) == pytest.approx(com, abs=1e-4)
    ends = np.array(poses[0]["cables"][0]["ends"])
    site = np.array(builders.robot().cables[0].sites_m[0])
    assert ends[0] == pytest.approx(frames["p_WR"][0, 1] + rotated(frames["q_WR"][0, 1], site), abs=1e-4)
