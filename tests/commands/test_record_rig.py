"""`record` against the rig, each in a process of its own: every protocol over every link, and the lengths it brings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.artifact import ArtifactData
from r2s2r_cli.store.read import read_artifact
from tests.commands.conftest import document
from tests.support.desk import QUIET, aligned_error, desk, link_options, project, read_truth
from tests.support.fake_robot import SLOPE

RUN = "random-0"
GAIT = """\
schema_version = 1
robot = "threebar"
name = "nod"
[[steps]]
target = [0.5, 1.0, 1.0, 1.0, 1.0, 1.0]
[[steps]]
target = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0]
"""
COUNT_M = 42e-12 * 1024 / 3.3
"""Capacitance times converter count [F]."""
WAYS = [
    (link, protocol) for link in ("pty", "tcp", "udp") for protocol in ("checked", "boards", "legacy")
]  # fmt: skip


def recorded(root: Path, link: str, protocol: str, *more: str, world: str = "") -> tuple[ArtifactData, np.ndarray]:
    """A random policy of two targets through this link; the recording, and its lengths minus the rig's [m]."""
    with desk(root, *link_options(link), "--protocol", protocol, "--fast", world=world) as rig:
        result = document(
            "record", "--project", str(root), "--random", "2", "--port", rig.address, "--protocol", protocol,
            "--no-draw", "--set", "record.rest_s=0.5", *more,
        )  # fmt: skip
    assert [run["ended"] for run in result["report"]["runs"]] == ["complete"]
    _, data = read_artifact(root / result["artifact"], "recording")
    sensors = data.group(RUN, "sensors")
    assert sensors is not None
    return data, aligned_error(sensors["t"], sensors["length"], read_truth(rig.truth))


def test_a_rig_on_a_pty_is_recorded_within_a_count(tmp_path: Path) -> None:
    """Sensors with nothing but their converter: at rest every length is the true one to within half a count (0.5 mm at
    20 pF), in motion to within what a cable moves in the tick that a sample is stamped with (60 mm/s for 20 ms)."""
    data, error = recorded(project(tmp_path / "p"), "pty", "checked", world=QUIET)
    sensors = data.group(RUN, "sensors")
    assert sensors is not None
    count = sensors["capacitance"] ** 2 / COUNT_M / SLOPE
    still = sensors["t"] > sensors["t"][-1] - 0.3
    assert np.nanmax((np.abs(error) / count)[still]) < 0.6
    assert np.nanmax(np.abs(error) - 0.6 * count) < 0.02 * 0.07
    assert np.isfinite(error).mean() == pytest.approx(1 / 3, abs=0.02)  # three boards take turns
    attributes = data.groups[f"runs/{RUN}"].attributes
    assert attributes["origin"] == "rig" and attributes["nature"] == "simulated" and attributes["clock"] == "board"


@pytest.mark.slow
@pytest.mark.parametrize(("link", "protocol"), WAYS)
def test_every_protocol_over_every_link_brings_the_lengths(tmp_path: Path, link: str, protocol: str) -> None:
    """With the ordinary errors of real sensors (5 mm offset of the day, 2 mm bow, a count of 1 mm, lag): the mean error
    of each sensor lies within 4 sd of that, all nine together within chi-square bounds, and about its mean a sensor
    errs by less than 4 mm."""
    _, error = recorded(project(tmp_path / "p"), link, protocol)
    mean = np.nanmean(error, axis=0)
    stated = np.hypot(0.005, 0.002)
    assert (np.abs(mean) < 4 * stated).all()
    assert 0.35 < np.sqrt(np.mean(mean**2)) / stated < 1.8
    assert np.nanstd(error, axis=0).max() < 0.004


@pytest.mark.slow
@pytest.mark.parametrize("protocol", ["checked", "boards", "legacy"])
def test_in_real_time_as_well(tmp_path: Path, protocol: str) -> None:
    """The same with the host's clock: 50 Hz, or less and said so on a busy machine; the lengths as good."""
    root = project(tmp_path / "p")
    with desk(root, "--link", "tcp", "--protocol", protocol, world=QUIET) as rig:
        result = document(
            "record", "--project", str(root), "--random", "2", "--port", rig.address, "--protocol", protocol,
            "--no-draw", "--simulated",
        )  # fmt: skip
    (run,) = result["report"]["runs"]
    assert run["ended"] == "complete"
    assert run["rate_hz"] == pytest.approx(50.0, rel=0.03) or run["late"] > 0
    _, data = read_artifact(root / result["artifact"], "recording")
    sensors = data.group(RUN, "sensors")
    assert sensors is not None
    error = aligned_error(sensors["t"], sensors["length"], read_truth(rig.truth))
    assert np.nanquantile(np.abs(error), 0.99) < 0.0025


def hash_of(root: Path, *words: str) -> str:
    """Content hash of what a command records from a rig of its own, on whatever port is free."""
    with desk(root, "--link", "tcp", "--protocol", "checked", "--fast") as rig:
        result = document(*words, "--project", str(root), "--port", rig.address, "--no-draw",
                          "--set", "record.rest_s=0.5")  # fmt: skip
    _, data = read_artifact(root / result["artifact"], "recording")
    for run in data.runs():
        assert "start_unix" not in data.groups[f"runs/{run}"].attributes
        assert data.groups[f"runs/{run}/link"].attributes["port"] == "lock-step"
    return str(result["content_sha256"])


@pytest.mark.slow
def test_a_recording_in_lock_step_is_the_same_again(tmp_path: Path) -> None:
    """Same seed, same policy, another process and port: the same hash; another policy has another one."""
    first, again = (hash_of(project(tmp_path / name), "record", "--random", "2") for name in ("one", "two"))
    assert first == again
    assert hash_of(project(tmp_path / "three"), "record", "--random", "2", "--seed", "1") != first


@pytest.mark.slow
def test_what_was_executed_in_lock_step_is_the_same_again(tmp_path: Path) -> None:
    """A policy, twice from where the robot was put, on the rig: the outcome is shown, it runs, both runs are complete;
    done again it has the same hash."""
    found = []
    for name in ("one", "two"):
        root = project(tmp_path / name)
        (root / "iterations" / "001").mkdir(parents=True)
        (root / "gait.toml").write_text(GAIT, "utf-8")
        found.append(hash_of(root, "execute", str(root / "gait.toml"), "--repeats", "2", "--yes"))
        header, data = read_artifact(root / "iterations" / "001" / "50-execute.h5", "recording")
        assert data.runs() == ["nod-1", "nod-2"]
        assert [run["ended"] for run in header.provenance.report["runs"]] == ["complete"] * 2
    assert found[0] == found[1]
