"""`r2s2r export --to mjcf`: a robot.toml becomes a model that MuJoCo reads, with the values that were asked for."""

from __future__ import annotations

import shlex
from pathlib import Path

import mujoco
import numpy as np
import pytest

from r2s2r_cli.rig.model import mjcf
from r2s2r_cli.store.project import Project
from tests.commands.conftest import document, invoke


@pytest.mark.parametrize("source", ["robot.toml", "."])
def test_a_robot_becomes_a_model(source: str, project: Path) -> None:
    """From the file or the project: the text is that of the rig's model, and its name is printed."""
    written = document("export", source, "--to", "mjcf", "--out", "out")
    assert (written["format"], written["files"]) == ("mjcf", ["out/threebar.xml"])
    assert Path("out/threebar.xml").read_text() == mjcf(Project.find(project).robot())
    assert mujoco.MjModel.from_xml_path("out/threebar.xml").nbody == 4


@pytest.mark.usefixtures("project")
def test_values_can_be_set() -> None:
    """Keys of robot.toml, list items by number, whole numbers, lists and options reach the model; the file stays."""
    before = Path("robot.toml").read_bytes()
    sets = {
        "contact.friction": "0.5", "cables.6.stiffness_n_per_m": "120", "rods.1.parts.0.mass_kg": "0.02",
        "name": "mine", "options.gravity": "[0, 0, -1.62]", "options.timestep_s": "0.002",
        "options.cone": "pyramidal", "options.rod_contact": "false", "cables.7.stiffness3_n_per_m3": "3",
        "options.restitution": "0.5",
    }  # fmt: skip
    flags = [text for key, value in sets.items() for text in ("--set", f"{key}={value}")]
    document("export", "robot.toml", "--to", "mjcf", *flags)
    model = mujoco.MjModel.from_xml_path("mine.xml")
    assert Path("robot.toml").read_bytes() == before
    assert model.geom("ground").friction[0] == 0.5
    assert model.actuator("passive6").biasprm[1] == -120.0
    assert model.body("rod_green").mass[0] == pytest.approx(0.1334 - 0.0105 + 0.02)
    np.testing.assert_array_equal(model.opt.gravity, [0.0, 0.0, -1.62])
    assert (model.opt.timestep, model.opt.cone) == (0.002, mujoco.mjtCone.mjCONE_PYRAMIDAL)
    assert model.geom("shaft0").contype[0] == 0
    assert model.tendon_stiffnesspoly[7, 1] == 3.0
    assert model.geom("cap0").solref[1] < 1.0


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        (("--set", "contact.friktion=0.5"), 2, "friktion"),
        (("--set", "contact.friction=-1"), 2, "contact.friction"),
        (("--set", "contact.friction=much"), 2, "contact.friction"),
        (("--set", "cables.99.stiffness_n_per_m=1"), 2, "0 to 8"),
        (("--set", "cables.six.stiffness_n_per_m=1"), 2, "0 to 8"),
        (("--set", "kables.6.stiffness_n_per_m=1"), 2, "robot.toml has no kables.6.stiffness_n_per_m"),
        (("--set", "name.x.y=1"), 2, "robot.toml has no name.x.y"),
        (("--set", "rods.0.parts.0.mass_kg=0"), 2, "rods.0.parts.0.mass_kg"),
        (("--set", "contact.friction"), 2, "an override has no value"),
        (("--set", "contact.friction=0.5\nname=1"), 2, "an override has more than one value"),
        (("--set", "options.timestep=1"), 2, "--set options.timestep_s=0.001"),
        (("--set", "options.timestep_s=0"), 2, "timestep_s cannot be 0"),
        (("--set", "options.timestep_s=fast"), 2, "options.timestep_s cannot be that"),
        (("--set", "options.gravity=[0, 0]"), 2, "options.gravity cannot be that"),
        (("--set", "options.rod_contact=1"), 2, "options.rod_contact cannot be that"),
        (("--set", "options.cone=round"), 2, "cone"),
        (("--set", "cables.0.stiffness3_n_per_m3=1"), 4, "no winched cable with a cubic law"),
        (("--run", "sample"), 2, "only trajectory and policy take one run"),
    ],
)
@pytest.mark.usefixtures("project")
def test_what_cannot_be_is_refused(arguments: tuple[str, ...], code: int, says: str) -> None:
    """A wrong key, value, place, option: exit code, the name of the culprit, and nothing written."""
    result = invoke("export", "robot.toml", "--to", "mjcf", *arguments)
    assert result.exit_code == code, result.output
    assert says in result.stderr
    assert list(Path().glob("*.xml")) == []


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ("options=3", "options.timestep_s=0.001"),
        ("options.=3", "options.timestep_s=0.001"),
        ("options.ridges=1", ""),
        ("options.gravity=[0, 0]", "options.gravity=[0.0, 0.0, -9.81]"),
        ("options.rod_contact=1", "options.rod_contact=true"),
        ("kables.6.stiffness_n_per_m=90", "cables.6.stiffness_n_per_m=90"),
        ("cables.99.stiffness_n_per_m=90", "cables.8.stiffness_n_per_m=90"),
        ("contact.friction.x=0.5", "contact.friction=0.5"),
        ("contact.x.y=0.5", ""),
        ("name.x.y=1", ""),
        ("contact.friction", "contact.friction=0.5"),
    ],
)
@pytest.mark.parametrize("joined", [True, False])
@pytest.mark.usefixtures("project")
def test_the_hint_takes_the_place_of_what_was_wrong(wrong: str, right: str, joined: bool) -> None:
    """Pasted, it is a command that works: nothing of what was refused is left in it, and all else stays."""
    typed = [f"--set={wrong}"] if joined else ["--set", wrong]
    before = ["export", "robot.toml", "--to", "mjcf", "--set", "contact.friction=0.4"]
    refused = invoke(*before, *typed, "--out", "out")
    assert refused.exit_code == 2 and list(Path().glob("out/*")) == []
    mended = shlex.split(refused.stderr.splitlines()[-1])[2:]
    assert mended[:6] == before and mended[-2:] == ["--out", "out"] and len(mended) == 8 + len(typed)
    assert wrong not in mended[6:] and mended[-3].endswith(right)
    assert invoke(*mended).exit_code == 0


@pytest.mark.usefixtures("estimated")
def test_only_a_robot_becomes_a_model() -> None:
    """An artifact is refused as a source, and --set for any other format."""
    record = "iterations/001/10-record.h5"
    result = invoke("export", record, "--to", "mjcf")
    assert result.exit_code == 4
    assert "an artifact holds no robot description" in result.stderr
    result = invoke("export", record, "--to", "csv", "--set", "contact.friction=1")
    assert result.exit_code == 2
    assert "--to mjcf" in result.stderr


@pytest.mark.usefixtures("project")
def test_a_file_that_is_there_stays() -> None:
    """The second export of the same robot needs --force."""
    document("export", ".", "--to", "mjcf")
    assert invoke("export", ".", "--to", "mjcf").exit_code == 2
    document("export", ".", "--to", "mjcf", "--force")
