"""What the user may point at: formats, sidecars, names, and paths that are not what they seem."""

from __future__ import annotations

import os
import socket
import subprocess
from pathlib import Path

import pytest

from r2s2r_cli.errors import InputError, UsageError
from r2s2r_cli.stages.import_ import check_source, find_format, import_source, merge_runs
from r2s2r_cli.stages.import_.files import FileBytes, clipped, file_size, nearest_name, read_source
from r2s2r_cli.stages.import_.sidecar import parse_sidecar, sidecar_path
from schemas.sidecar import MINIMAL_SIDECAR, PLACEHOLDER
from tests.support.import_samples import SIDECAR, frame_json, sample_robot, small_csv, write_authors_folder

ROBOT = sample_robot()


def log(folder: Path, name: str = "log") -> Path:
    """A good CSV with its sidecar."""
    (folder / f"{name}.toml").write_text(SIDECAR)
    path = folder / f"{name}.csv"
    path.write_text(small_csv())
    return path


def refusal(path: Path, **more: object) -> InputError:
    """The error of a source that must be refused."""
    with pytest.raises(InputError) as caught:
        import_source(path, robot=ROBOT, **more)  # type: ignore[arg-type]
    assert caught.value.where and caught.value.hint
    return caught.value


def test_runs_are_named_by_stem_and_merged_in_order(tmp_path: Path) -> None:
    """Two files become two runs of one recording; the files that were read are listed."""
    runs = [import_source(log(tmp_path, name), robot=ROBOT) for name in ("b", "a")]
    data = merge_runs(runs)
    assert data.kind == "recording"
    assert data.runs() == ["b", "a"]
    assert data.group("a", "caps") is not None
    assert runs[0].files == (tmp_path / "b.csv", tmp_path / "b.toml")


def test_two_runs_of_one_name_are_refused(tmp_path: Path) -> None:
    """The same stem from two folders would hide one run."""
    for folder in ("x", "y"):
        (tmp_path / folder).mkdir()
    runs = [import_source(log(tmp_path / folder), robot=ROBOT) for folder in ("x", "y")]
    with pytest.raises(UsageError, match="two sources"):
        merge_runs(runs)


def test_a_log_without_sidecar_is_refused_and_shown_one(tmp_path: Path) -> None:
    """The message shows a minimal sidecar, which is a valid one once its source says something."""
    path = log(tmp_path)
    (tmp_path / "log.toml").unlink()
    error = refusal(path)
    assert MINIMAL_SIDECAR.strip() in error.expected
    assert parse_sidecar(MINIMAL_SIDECAR.replace(PLACEHOLDER, "tribar").encode(), "x").robot == "threebar"
    assert import_source(path, robot=ROBOT, sidecar=parse_sidecar(SIDECAR.encode(), "x")).files == (path,)


def test_the_hint_for_a_missing_sidecar_writes_a_valid_one(tmp_path: Path) -> None:
    """The pasted command makes the file; only its source is still to be written."""
    path = log(tmp_path)
    (tmp_path / "log.toml").unlink()
    subprocess.run(["sh", "-c", refusal(path).hint], check=True)
    text = (tmp_path / "log.toml").read_text()
    with pytest.raises(InputError, match="source is wrong"):
        parse_sidecar(text.encode(), "x")
    assert parse_sidecar(text.replace(PLACEHOLDER, "tribar").encode(), "x").nature == "measured"


def test_the_sidecar_of_a_folder_lies_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`run.1/` has `run.1.toml`, `run.1.csv` has `run.1.toml`, also when named relative to here."""
    (tmp_path / "run.1").mkdir()
    (tmp_path / "run.1.csv").write_text("")
    assert sidecar_path(tmp_path / "run.1") == tmp_path / "run.1.toml"
    assert sidecar_path(tmp_path / "run.1.csv") == tmp_path / "run.1.toml"
    monkeypatch.chdir(tmp_path / "run.1")
    assert sidecar_path(Path()).absolute() == tmp_path / "run.1.toml"


def test_formats_are_found_by_what_lies_there(tmp_path: Path) -> None:
    """A .csv, a folder with data/, a folder with both lists; anything else is refused and says what was sought."""
    assert find_format(log(tmp_path)) == "trajectory_csv"
    assert find_format(write_authors_folder(tmp_path / "walk", [frame_json()])) == "authors_folder"
    tum = tmp_path / "tum"
    tum.mkdir()
    (tum / "rgb.txt").touch()
    assert "no recording" in refusal(tum).what
    (tum / "depth.txt").touch()
    assert find_format(tum) == "tum_rgbd"
    other = tmp_path / "log.bag"
    other.write_bytes(b"#ROSBAG")
    assert "'.bag'" in refusal(other).what


def test_a_source_can_be_checked_before_it_is_read(tmp_path: Path) -> None:
    """The check gives the format and refuses what reading would refuse, without touching the content."""
    path = log(tmp_path)
    path.write_bytes(bytes(range(256)))
    assert check_source(path) == check_source(path, "trajectory_csv") == "trajectory_csv"
    (tmp_path / "loop.csv").symlink_to(tmp_path / "loop.csv")
    for wrong, format_ in ((tmp_path, "trajectory_csv"), (path, "tum_rgbd"), (tmp_path / "loop.csv", "auto")):
        with pytest.raises(InputError):
            check_source(wrong, format_)  # type: ignore[arg-type]


def test_an_unknown_format_is_a_usage_error(tmp_path: Path) -> None:
    """A format that is none ends with exit code 2 and the list."""
    with pytest.raises(UsageError) as caught:
        import_source(log(tmp_path), robot=ROBOT, format="csv")  # type: ignore[arg-type]
    assert "trajectory_csv" in caught.value.expected


def test_a_missing_file_is_an_error_with_its_neighbour(tmp_path: Path) -> None:
    """A misspelt name is answered with the nearest file of the folder."""
    log(tmp_path, "crawl")
    assert "did you mean 'crawl.csv'" in refusal(tmp_path / "crawk.csv").what
    assert refusal(tmp_path / "no" / "such.csv").hint == f"ls {tmp_path}"  # a folder that is there


def test_a_folder_where_a_file_is_expected_and_the_reverse(tmp_path: Path) -> None:
    """The two kinds are told apart whatever their names."""
    (tmp_path / "log.csv").mkdir()
    assert "is a folder" in refusal(tmp_path / "log.csv", format="trajectory_csv").what
    assert "is not a folder" in refusal(log(tmp_path, "b"), format="authors_folder").what
    (tmp_path / "b.toml").unlink()
    (tmp_path / "b.toml").mkdir()
    assert "is a folder" in refusal(tmp_path / "b.csv").what


def test_loops_of_links_and_links_to_nothing_are_errors(tmp_path: Path) -> None:
    """A link to itself and a dangling one end in a message, also as sidecar."""
    (tmp_path / "loop.csv").symlink_to(tmp_path / "loop.csv")
    assert "cannot be read" in refusal(tmp_path / "loop.csv").what
    (tmp_path / "gone.csv").symlink_to(tmp_path / "nothing")
    assert "does not exist" in refusal(tmp_path / "gone.csv").what
    path = log(tmp_path)
    (tmp_path / "log.toml").unlink()
    (tmp_path / "log.toml").symlink_to(tmp_path / "log.toml")
    assert "sidecar cannot be read" in refusal(path).what


def test_pipes_and_sockets_are_refused_without_being_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Reading a pipe that nobody writes to would hang for ever."""
    os.mkfifo(tmp_path / "pipe.csv")
    assert "not a regular file" in refusal(tmp_path / "pipe.csv").what
    assert "not a regular file" in refusal(Path("/dev/zero"), format="trajectory_csv").what
    with socket.socket(socket.AF_UNIX) as server:
        monkeypatch.chdir(tmp_path)  # paths of sockets are short
        server.bind("s.csv")
        assert "not a regular file" in refusal(tmp_path / "s.csv").what


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_permission_denied_is_an_error(tmp_path: Path) -> None:
    """A file that may not be read ends in a message."""
    path = log(tmp_path)
    path.chmod(0)
    assert "cannot be read" in refusal(path).what


def test_a_huge_file_is_refused_before_it_is_read(tmp_path: Path) -> None:
    """A sparse file of 1 TiB is refused by its size."""
    path = log(tmp_path)
    with path.open("r+b") as file:
        file.truncate(2**40)
    assert "too large" in refusal(path).what


@pytest.mark.parametrize(
    ("name", "run"),
    [("my run", "my-run"), ("-x", "x"), ("a*b", "a-b"), (".hidden", "hidden"), ("über", "run-über"), ("* *", "run")],
)
def test_a_name_that_cannot_be_a_run_gives_a_like_one(tmp_path: Path, name: str, run: str) -> None:
    """Names with blanks or signs cannot name a group: the run is called otherwise, which is said; file and sidecar keep
    theirs, in a folder with a blank as well."""
    (tmp_path / "the logs").mkdir()
    made = import_source(log(tmp_path / "the logs", name), robot=ROBOT)
    assert made.name == made.report.run == run
    assert made.report.warnings[0].startswith(f"called {run}, since {name!r} cannot name a run")
    assert [path.name for path in made.files] == [f"{name}.csv", f"{name}.toml"]
    plain = import_source(log(tmp_path, "plain-1"), robot=ROBOT)
    assert plain.name == "plain-1" and not any("cannot name" in text for text in plain.report.warnings)


def test_two_sources_of_one_run_are_told_apart_with_their_sidecars(tmp_path: Path) -> None:
    """The hint, pasted, gives one of them another name that is free, and its sidecar with it."""
    log(tmp_path, "a-b-2")  # what would be the first name
    sources = [log(tmp_path, "a-b"), log(tmp_path, "a b")]
    with pytest.raises(UsageError, match="two sources") as caught:
        merge_runs([import_source(path, robot=ROBOT) for path in sources])
    subprocess.run(["sh", "-c", caught.value.hint], check=True)
    assert {path.name for path in tmp_path.iterdir()} == {
        f"{stem}.{ending}" for stem in ("a-b", "a-b-2", "a-b-3") for ending in ("csv", "toml")
    }
    made = merge_runs([import_source(tmp_path / f"{name}.csv", robot=ROBOT) for name in ("a-b", "a-b-3")])
    assert made.runs() == ["a-b", "a-b-3"]


@pytest.mark.parametrize("path", ["a\0b.csv", "x" * 5000 + ".csv"])
def test_impossible_paths_are_errors(path: str) -> None:
    """A NUL byte or an endless name in a path ends in a printable message."""
    error = refusal(Path(path), format="trajectory_csv")
    assert "\0" not in str(error)


def test_bytes_are_read_when_they_are_asked_for(tmp_path: Path) -> None:
    """A frame that vanishes between check and write is an error then, not before."""
    path = tmp_path / "a.png"
    path.write_bytes(b"1")
    lazy = FileBytes((path, path), "the frame")
    assert list(lazy) == [b"1", b"1"]
    path.unlink()
    with pytest.raises(InputError, match="does not exist"):
        next(iter(lazy))


def test_limits_are_those_of_the_caller(tmp_path: Path) -> None:
    """A file of exactly the limit passes, one byte more does not."""
    path = tmp_path / "a"
    path.write_bytes(b"12345")
    assert file_size(path, "it", limit=5) == 5
    assert read_source(path, "it", limit=5) == b"12345"
    with pytest.raises(InputError, match="too large"):
        read_source(path, "it", limit=4)


def test_near_names_ignore_case_and_far_ones_are_not_forced() -> None:
    """A name in capitals is recognised; nonsense is not matched; long texts are clipped."""
    assert nearest_name("T_S", ["t_s", "cap0_x_m"]) == "t_s"
    assert nearest_name("temperature", ["t_s", "cap0_x_m"]) == ""
    assert len(clipped("x" * 1000)) < 90
