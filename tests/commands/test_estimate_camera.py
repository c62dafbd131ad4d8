"""`estimate` of an imported folder of pictures, through the command line: artifact, pictures, page, film."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.commands.bench_estimate_case import TUNING_SEEDS, Case, make_case
from r2s2r_cli.commands.estimate_hints import hints_of
from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.estimate.unseen import Unseen
from r2s2r_cli.store.read import read_artifact
from tests.commands.conftest import invoke
from tests.support import builders

RUN_S = 3.0


def write_folder(case: Case, folder: Path) -> None:
    """The case as the authors' recorder would have left it: one JSON, one colour and one depth picture a frame."""
    lens, sensors, commands = case.frames.lens, case.streams["sensors"], case.streams["commands"]
    for name in ("color", "depth", "data"):
        (folder / name).mkdir(parents=True)
    matrix = [[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]]
    facts = {"im_w": lens.width, "im_h": lens.height, "depth_scale": 1 / case.frames.depth_scale, "cam_intr": matrix}
    (folder / "config.json").write_text(json.dumps(facts))
    for k, t in enumerate(case.frames.t):
        (folder / "color" / f"{k:04d}.jpg").write_bytes(case.frames.color[k])
        (folder / "depth" / f"{k:04d}.png").write_bytes(case.frames.depth[k])
        rows = sensors["length"][(sensors["t"] <= t) & (sensors["t"] > t - 0.05)]
        heard = {str(i): {"length": 1e3 * float(column[np.isfinite(column)][-1])}
                 for i, column in enumerate(rows.T) if np.isfinite(column).any()}  # fmt: skip
        row = max(int(np.searchsorted(commands["t"], t)) - 1, 0)
        motors = {str(i): {"target": float(target), "speed": 80 * float(speed)} for i, (target, speed) in
                  enumerate(zip(commands["target"][row], commands["control"][row], strict=True))}  # fmt: skip
        frame = {"header": {"secs": 1.7e9 + float(t)}, "info": {"max_speed": 80}, "sensors": heard, "motors": motors}
        (folder / "data" / f"{k:04d}.json").write_text(json.dumps(frame))


@pytest.mark.parametrize(
    ("stage", "flags", "expected"),
    [
        ("execute", {"policies": ["straight"], "port": "udp://h:1"},
         "r2s2r execute straight --port udp://h:1 --iteration 2 --force --camera realsense"),
        ("execute", {"port": "udp://h:1", "camera": "open3d"},
         "r2s2r execute --port udp://h:1 --camera open3d --iteration 2 --force"),
        ("record", {"random": 15, "port": "udp://h:1"},
         "r2s2r record --random 15 --port udp://h:1 --iteration 2 --force --camera realsense --dry-run   # "),
        ("bench", {}, "r2s2r import crawl.csv"),
    ],
)  # fmt: skip
def test_runs_that_nobody_saw_have_their_own_command_as_the_hint(
    tmp_path: Path, stage: str, flags: dict[str, Any], expected: str
) -> None:
    """That which moved the robot, with a camera; none that moves it without a question."""
    path = tmp_path / "iterations/002/50-execute.h5"
    made = builders.provenance(stage=stage, settings={"flags": flags}, overrides={}, seed=None)
    with pytest.raises(Unseen) as caught, hints_of("50-execute.h5", path, made):
        raise Unseen("nothing", hint="r2s2r import crawl.csv")
    assert caught.value.hint.startswith(expected)
    with pytest.raises(Unseen) as of_rig, hints_of("50-execute.h5", path, made, rig=True):
        raise Unseen("nothing", hint="r2s2r import crawl.csv")
    asked = of_rig.value.hint.partition("#")[0].split()
    assert asked == [
        word if word != "realsense" else "rig://127.0.0.1:9000" for word in caught.value.hint.partition("#")[0].split()
    ]
    with pytest.raises(InputError, match="few") as other, hints_of("50-execute.h5", path, made):
        raise InputError("few", hint="r2s2r inspect 10-record.h5")
    assert other.value.hint == "r2s2r inspect 50-execute.h5"


@pytest.mark.slow
def test_a_folder_of_pictures_becomes_states(tmp_path: Path) -> None:
    """Import, estimate, validate: distances of caps true to 3 mm on average, everything drawn, no error."""
    case = make_case(TUNING_SEEDS[1], tmp_path / "case", run_s=RUN_S)
    write_folder(case, tmp_path / "walk")
    (tmp_path / "walk.toml").write_text('robot = "threebar"\nsource = "rig"\nnature = "simulated"\n')
    project = tmp_path / "bot"
    assert invoke("init", str(project)).exit_code == 0
    assert invoke("import", str(tmp_path / "walk"), "--project", str(project)).exit_code == 0
    result = invoke("estimate", "--project", str(project), "--json")
    assert result.exit_code == 0, result.stderr
    iteration = project / "iterations" / "001"
    drawn = {path.name for path in iteration.glob("20-estimate*")}
    assert drawn >= {f"20-estimate-walk{end}" for end in (".png", "-camera.png", "-overlay.png", "-overlay.mp4")}
    report = json.loads(result.stdout)["report"]["runs"][0]
    assert report["camera"]["height_m"] == pytest.approx(1.44, abs=0.005)
    _, data = read_artifact(iteration / "20-estimate.h5", "estimate")
    frames = data.groups["runs/walk/frames"]
    true = case.truth.p_WE[frames["source_frame"]]
    apart = [np.linalg.norm(p[:, :, None] - p[:, None], axis=-1) for p in (frames["p_WE"], true)]
    assert np.abs(apart[0] - apart[1]).mean() < 0.003
    assert invoke("validate", "--project", str(project)).exit_code == 0
