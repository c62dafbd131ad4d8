"""Commands that look: status, inspect, doctor, bench."""

from __future__ import annotations

import json
import os
import re
import shlex
import sys
from pathlib import Path

import h5py
import pytest

from r2s2r_cli.store.header import read_header
from tests.commands.conftest import document, invoke

RECORD = "iterations/001/10-record.h5"
ESTIMATE = "iterations/001/20-estimate.h5"


def states() -> dict[str, tuple[str, list[str]]]:
    """Artifact -> (state, reasons) as `status --json` says it."""
    return {a["artifact"]: (a["state"], a["reasons"]) for a in document("status")["artifacts"]}


def test_everything_is_fresh_after_the_stages(estimated: Path) -> None:
    """Right after import and estimate nothing is stale and --check passes."""
    assert {state for state, _ in states().values()} == {"fresh"}
    assert invoke("status", "--check").exit_code == 0


def test_comments_order_and_times_do_not_count(estimated: Path) -> None:
    """A comment, another order of the sections and newer file times leave everything fresh."""
    for name in ("project.toml", "robot.toml", "sample.toml"):
        Path(name).write_text("# a remark\n" + Path(name).read_text() + "\n# another\n")
    head, *sections = Path("project.toml").read_text().split("\n[")
    Path("project.toml").write_text("\n[".join([head, *reversed(sections)]) + "\n")
    for path in estimated.rglob("*.*"):
        os.utime(path, (2e9, 2e9))
    assert {state for state, _ in states().values()} == {"fresh"}


@pytest.mark.parametrize("command", [["status", "--project"], ["inspect"], ["export"]])
def test_an_error_about_a_name_that_is_not_utf8_is_a_document(estimated: Path, command: list[str]) -> None:
    """A byte that is no character stands in it as on the other stream, and the document is JSON that all can read."""
    refused = invoke(*command, "/nowhere/\udcff", "--json")
    error = json.loads(refused.stdout)
    assert refused.exit_code == error["exit_code"] == 4 and "Traceback" not in refused.stderr
    assert "/nowhere/\\udcff" in error["where"]


def test_a_document_with_a_name_that_is_not_utf8_is_json(estimated: Path) -> None:
    """What was written is named as on the other stream; numbers and truth values stay what they are."""
    Path("o\udcff").mkdir()
    written = document("export", RECORD, "--to", "npz", "--out", "o\udcff")
    assert written["files"] == ["o\\udcff/10-record.npz"] and written["schema"] == "r2s2r.export/1"
    Path("robot.toml").rename("robot\udcff.toml")
    answer = json.loads(invoke("validate", "robot\udcff.toml", "--json").stdout)
    assert answer["files"] == ["robot\\udcff.toml"]


def test_a_setting_names_itself(estimated: Path) -> None:
    """A changed setting makes its own stage stale, with old and new value, and no other."""
    text = Path("project.toml").read_text()
    Path("project.toml").write_text(text.replace("contact_clearance_m = 0.003", "contact_clearance_m = 0.004"))
    found = states()
    assert found[RECORD] == ("fresh", [])
    assert found[ESTIMATE] == ("stale", ["setting estimate.contact_clearance_m was 0.003, is 0.004"])


def test_a_value_of_the_robot_names_itself(estimated: Path) -> None:
    """A changed rod length makes stale what used it; a motor's speed, which nobody used, does not."""
    text = Path("robot.toml").read_text()
    Path("robot.toml").write_text(text.replace("no_load_rad_per_s = ", "no_load_rad_per_s = 1"))
    assert {state for state, _ in states().values()} == {"fresh"}
    Path("robot.toml").write_text(text.replace("length_m = 0.325", "length_m = 0.326", 1))
    assert states()[ESTIMATE] == ("stale", ["robot.toml: rods.0.length_m was 0.325, is 0.326",
                                            "input iterations/001/10-record.h5 is stale itself"])  # fmt: skip


def test_a_changed_source_travels_down(estimated: Path) -> None:
    """Another byte in the log makes the recording stale, and the estimate with it; a new import, only the estimate."""
    text = Path("sample.csv").read_text().rstrip("\n").splitlines()
    Path("sample.csv").write_text("\n".join(text[:-1]) + "\n")
    found = states()
    assert found[RECORD] == ("stale", ["input sample.csv changed: its bytes are others"])
    assert found[ESTIMATE] == ("stale", ["input iterations/001/10-record.h5 is stale itself"])
    assert invoke("import", "sample.csv", "--no-draw").exit_code == 0
    assert states()[ESTIMATE] == ("stale", [f"input {RECORD} changed: its content hash is another"])


def test_a_source_that_moved_away_is_not_stale(estimated: Path) -> None:
    """Logs may live elsewhere: without its source a recording stays what it was."""
    Path("sample.csv").unlink()
    assert states()[RECORD] == ("fresh", [])


def test_a_new_stage_version_makes_its_results_stale(estimated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Raising a stage's version is a reason of its own."""
    from schemas import versions

    now = versions.STAGE_VERSIONS["estimate"]
    monkeypatch.setitem(versions.STAGE_VERSIONS, "estimate", now + 1)
    assert states()[ESTIMATE] == ("stale", [f"stage estimate changed: made by version {now}, now {now + 1}"])


def test_status_of_a_damaged_artifact(estimated: Path) -> None:
    """A damaged head is said, and the next command is recover."""
    data = bytearray((estimated / ESTIMATE).read_bytes())
    data[200] ^= 1
    (estimated / ESTIMATE).write_bytes(data)
    assert states()[ESTIMATE][0] == "damaged"
    assert document("status")["next"] == f"r2s2r recover {ESTIMATE}"


def test_a_truncated_artifact_is_damaged(estimated: Path) -> None:
    """A file that lost its end is never called fresh, by status or by its own stage."""
    data = (estimated / ESTIMATE).read_bytes()
    (estimated / ESTIMATE).write_bytes(data[: len(data) // 2])
    assert states()[ESTIMATE] == ("damaged", ["the file was cut off"])
    assert document("estimate", "--no-draw")["state"] == "done"


def test_one_changed_byte_is_noticed(estimated: Path) -> None:
    """A changed byte in the body is no reason to rest: the stage makes its artifact again."""
    data = bytearray((estimated / ESTIMATE).read_bytes())
    data[len(data) // 2] ^= 1
    (estimated / ESTIMATE).write_bytes(data)
    assert invoke("status", "--check").exit_code == 3
    answer = document("estimate", "--no-draw")
    assert (answer["state"], answer["reasons"]) == (
        "done", ["what is there is damaged: bytes of the file changed after it was sealed"],
    )  # fmt: skip


def test_the_next_command_can_be_pasted(estimated: Path) -> None:
    """The hint of status names the sources and the iteration; run as it is, everything is fresh again."""
    text = Path("sample.csv").read_text().rstrip("\n").splitlines()
    Path("sample.csv").write_text("\n".join(text[:-1]) + "\n")
    for expected in ("r2s2r import sample.csv --iteration 1", "r2s2r estimate --iteration 1"):
        command = document("status")["next"]
        assert command == expected
        assert invoke(*shlex.split(command)[1:], "--no-draw").exit_code == 0
    assert document("status")["next"] == "r2s2r identify --iteration 1"


def test_inspect_shows_units_and_provenance(estimated: Path) -> None:
    """The tree names shape, unit, frame and meaning; the header says how it came to be."""
    answer = document("inspect", ESTIMATE)
    nodes = {node["path"]: node for node in answer["nodes"]}
    caps = nodes["runs/sample/frames/p_WE"]
    assert (caps["unit"], caps["frame"], caps["dims"]) == ("m", "W", "frame,cap,xyz")
    assert caps["description"]
    made = answer["header"]["provenance"]
    assert (made["stage"], made["inputs"][0]["path"]) == ("estimate", RECORD)
    assert made["inputs"][0]["sha256"] == read_header(estimated / RECORD).content_sha256


def test_inspect_says_what_attributes_are(estimated: Path) -> None:
    """Each has a line of its own with its value, its unit and what it is; of a file of others its value alone."""
    words = [line.split() for line in invoke("inspect", ESTIMATE).stdout.splitlines()]
    assert ["runs/sample@robot", "str", "1", "threebar", "(name", "of", "the"] in [line[:7] for line in words]
    with h5py.File("foreign.h5", "w") as file:
        file.create_group("of_others").attrs["mass"] = 1.25
    assert "of_others@mass 1.25" in " ".join(invoke("inspect", "foreign.h5").stdout.split())


def test_inspect_names_what_differs(estimated: Path) -> None:
    """--same-as leaves with 3 and names the datasets where the contents differ."""
    (estimated / "other.h5").write_bytes((estimated / ESTIMATE).read_bytes())
    settings = ("--set", "estimate.contact_clearance_m=0.02", "--no-draw")
    assert invoke("estimate", *settings).exit_code == 0
    result = invoke("inspect", ESTIMATE, "--same-as", "other.h5")
    assert result.exit_code == 3
    assert "differs: runs/sample/frames/contact" in result.stdout


SHORT_POLICY = """\
schema_version = 1
robot = "threebar"
name = "short"
[[steps]]
target = [0, 1]
"""


@pytest.mark.parametrize(
    "arguments", [("status", "--check"), ("inspect", ESTIMATE, "--same-as", RECORD), ("validate", "short.toml")]
)
def test_a_failed_gate_still_prints_one_document(estimated: Path, arguments: tuple[str, ...]) -> None:
    """With --json a command whose gate is not met leaves with 3 and has printed its result, once."""
    Path("short.toml").write_text(SHORT_POLICY)
    text = Path("project.toml").read_text()
    Path("project.toml").write_text(text.replace("contact_clearance_m = 0.003", "contact_clearance_m = 0.05"))
    result = invoke(*arguments, "--json")
    assert result.exit_code == 3, result.stderr
    assert json.loads(result.stdout)["schema"] == f"r2s2r.{arguments[0]}/1"


def test_inspect_reads_a_foreign_file(tmp_path: Path) -> None:
    """An HDF5 file of another program is shown as it is."""
    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file.create_dataset("a/b", data=[1.0, 2.0])
    answer = document("inspect", str(tmp_path / "foreign.h5"))
    assert answer["header"] is None
    assert [node["path"] for node in answer["nodes"]] == ["a", "a/b"]


@pytest.mark.parametrize("content", [b"", b"\x89HDF\r\n\x1a\n" + bytes(100), b"hello", bytes(5000)])
def test_inspect_refuses_what_is_no_hdf5(tmp_path: Path, content: bytes) -> None:
    """Empty, torn and other files are refused with a hint."""
    (tmp_path / "x.h5").write_bytes(content)
    result = invoke("inspect", str(tmp_path / "x.h5"))
    assert result.exit_code == 4
    assert result.stderr.splitlines()[-1].startswith("hint: ")


def test_doctor_names_the_project_and_the_libraries(project: Path) -> None:
    """doctor finds this project, our schemas, an HDF5 library that writes and reads, ports and ways to a camera."""
    probes = {probe["name"]: probe for probe in document("doctor")["probes"]}
    assert probes["schemas"]["state"] == probes["HDF5 write and read"]["state"] == "ok"
    assert str(project) in probes["project"]["found"]
    assert "serial ports" in probes or any(name.startswith(("/dev/", "COM")) for name in probes)
    assert probes["import mujoco"]["state"] == "ok" and "--camera open3d" in probes["RealSense drivers"]["found"]
    assert {probe["state"] for name, probe in probes.items() if name.startswith("import ")} <= {"ok", "warning"}


def test_doctor_names_the_package_to_install(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A library that does not import is a failed gate with the remedy as the hint."""
    module = sys.modules["r2s2r_cli.commands.doctor"]  # the package's attribute of that name is the command
    monkeypatch.setattr(module, "LIBRARIES", {"no_such_library": ("error", "apt-get install it")})
    result = invoke("doctor")
    assert result.exit_code == 3
    assert result.stderr.splitlines()[-1] == "hint: apt-get install it"


def test_doctor_on_a_machine_that_is_too_slow(project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What does not end in time has failed, the trial of HDF5 as well: a gate, no traceback."""
    module = sys.modules["r2s2r_cli.commands.doctor"]
    monkeypatch.setattr(module, "LIBRARIES", {})
    monkeypatch.setattr(module, "IMPORT_LIMIT_S", 0.001)
    result = invoke("doctor")
    assert result.exit_code == 3
    assert "received: it took over 0.001 s" in result.stderr


@pytest.mark.parametrize("version", [(3, 10), (3, 13)])
def test_doctor_knows_which_python_is_ours(version: tuple[int, int], monkeypatch: pytest.MonkeyPatch) -> None:
    """That of pyproject.toml: 3.11 or 3.12."""
    module = sys.modules["r2s2r_cli.commands.doctor"]
    monkeypatch.setattr(module.sys, "version_info", version)
    probe = next(module._installation())
    monkeypatch.undo()
    assert (probe.state, probe.hint) == ("error", "install Python 3.11 or 3.12")


def test_doctor_and_the_readme_name_the_same_packages_for_open3d() -> None:
    """What open3d loads: one list, also where the machine is set up."""
    module, root = sys.modules["r2s2r_cli.commands.doctor"], Path(__file__).parents[2]
    assert f"sudo apt-get install {module.OPEN3D_NEEDS} " in (root / "README.md").read_text()
    listed = re.search(r'wanted="(.*?)"', (root / ".ci" / "system-libs").read_text(), re.DOTALL)
    assert listed is not None
    assert [row.split()[1] for row in listed[1].splitlines()] == module.OPEN3D_NEEDS.split()


def test_bench_prints_ratios(project: Path) -> None:
    """bench startup measures in fresh processes and gives each time as a multiple of a bare interpreter."""
    result = invoke("bench", "startup", "--repeats", "1", "--json")
    answer = json.loads(result.stdout)
    assert answer["ratio_to_python"]["python -c pass"] == 1.0
    assert set(answer["seconds"]) == set(answer["ratio_to_python"])
