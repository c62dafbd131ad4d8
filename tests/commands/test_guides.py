"""What the guides show works as it stands there."""

from __future__ import annotations

import re
import shlex
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.devices.link import Sample
from r2s2r_cli.hardware import open_link
from r2s2r_cli.stages.import_.authors_json import parse_frame
from tests.commands.conftest import document, invoke
from tests.support.fake_robot import FakeLink, calibrated

GUIDES = Path(__file__).resolve().parents[2] / "docs" / "guides"


def _block(page: str, language: str) -> str:
    found = re.search(rf"^```{language}\n(.*?)^```", (GUIDES / page).read_text(), flags=re.MULTILINE | re.DOTALL)
    assert found is not None, f"{page} has no {language} block"
    return found[1]


def test_the_policy_of_the_guide_validates(project: Path) -> None:
    """The example has no error and no warning; a slip in it is found when the whole project is validated."""
    Path("policies").mkdir()
    Path("policies/crawl.toml").write_text(_block("policy.md", "toml"))
    result = invoke("validate", "policies/crawl.toml")
    assert result.exit_code == 0, result.stdout
    assert "0 errors, 0 warnings" in result.stdout + result.stderr
    Path("policies/crawl.toml").write_text(_block("policy.md", "toml").replace("1.0, 0.1", "1.5, 0.1"))
    assert invoke("validate").exit_code != 0


def test_the_scripts_of_the_guides_leave_no_motor_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """While the caller of the check of signs prints, and after both, all motors are off; inside a closed terminal ends
    them as Ctrl-C does: a robot without a watchdog would drive on."""
    robot = calibrated()
    link, heard = FakeLink(robot), []

    def look(number: int, sample: Sample) -> Sample:
        heard.append(signal.getsignal(signal.SIGHUP))
        return sample

    link.on_read = look
    monkeypatch.setattr(open_link, "open_link", lambda *_, **__: link)
    before = signal.getsignal(signal.SIGHUP)
    signs: dict[str, Any] = {"__name__": "signs"}
    exec(_block("record.md", "python"), signs)
    found = []
    for change in signs["changes"]("fake", robot, "legacy"):
        assert not link.driven.any()
        found.append(change)
    assert np.array_equal(np.array(found) < -1e-3, np.eye(6, dtype=bool))  # each motor shortens its own cable
    library: dict[str, Any] = {"__name__": "library"}
    exec(_block("connect.md", "python"), library)
    library["to_target"]("fake", robot, np.full(6, 0.5))
    assert not link.driven.any() and before not in heard and signal.getsignal(signal.SIGHUP) == before


def test_the_frame_of_the_guide_is_read() -> None:
    """Every value of the example reaches the record, in SI; what is null was not seen."""
    record = parse_frame(_block("authors-folder.md", "json").encode(), "guide")
    assert record.t == 1676990000.125
    assert record.info["max_speed"] == 80
    assert record.motors[0]["encoder_length"] == pytest.approx(0.0112)
    assert record.sensors[0] == pytest.approx((21.07e-12, 0.1314))
    assert record.imu[0][2] == pytest.approx(0.99 * 9.80665)
    assert record.mocap == {0: pytest.approx((0.1025, -0.0401, 0.0174))}


def test_the_identify_commands_of_the_guide_are_requests(estimated: Path) -> None:
    """Every command of the guide, on the sample's run, asks for something that exists."""
    page = (GUIDES / "identify.md").read_text()
    lines = re.findall(r"^(r2s2r identify .*)$", page, flags=re.MULTILINE)
    options = re.findall(r"`(--(?:free|with-effect) [^`]+)`", page)
    asked = [*lines, *(f"r2s2r identify {option}" for option in options if "ID" not in option)]
    assert len(lines) >= 3 and len(asked) >= 6
    for line in asked:
        words = shlex.split(line.replace("crawl:1-7", "sample:1-2").replace("crawl:8-11", "sample:3"), comments=True)
        result = invoke(*words[1:], "--dry-run")
        assert result.exit_code == 0, (line, result.stderr)


def test_the_export_commands_of_the_guide_run(estimated: Path) -> None:
    """The commands as they stand in the guide, and the files that its table names."""
    for line in _block("export.md", "sh").splitlines():
        words = line.partition("#")[0].split()
        assert words[:2] == ["r2s2r", "export"]
        assert document(*words[1:])["files"]
    for name in ("20-estimate/runs/sample/frames.csv", "20-estimate/runs/sample/frames_by_sensor.csv",
                 "20-estimate/runs/sample/ground.csv", "20-estimate/attributes.json"):  # fmt: skip
        assert (Path("exported") / name).is_file(), name
