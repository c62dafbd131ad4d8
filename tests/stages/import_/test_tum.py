"""TUM RGB-D folders made in a temporary folder, and the association of stamps by brute force."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.import_ import import_source
from r2s2r_cli.stages.import_.tum import associate
from tests.support.import_samples import sample_robot, write_tum_folder
from tests.support.run_layout import assert_run_layout

ROBOT = sample_robot()
START = 1305031102.0


def refusal(root: Path) -> InputError:
    """The error of a folder that must be refused."""
    with pytest.raises(InputError) as caught:
        import_source(root, robot=ROBOT)
    assert caught.value.hint
    return caught.value


def stamps(*offsets: float) -> list[float]:
    """Wall-clock stamps."""
    return [START + offset for offset in offsets]


def test_frames_are_paired_by_nearest_stamp(tmp_path: Path) -> None:
    """Nearest depth within 20 ms, each used once; both streams are whole, times start at the first stamp."""
    root = write_tum_folder(tmp_path / "desk", stamps(0.0, 0.033, 0.066, 0.2), stamps(0.004, 0.036, 0.1, 0.219))
    run = import_source(root, robot=ROBOT)
    camera = run.groups["camera"]
    assert camera["pair"].tolist() == [0, 1, -1, 3]
    assert camera["t"] == pytest.approx([0.0, 0.033, 0.066, 0.2], abs=1e-6)
    assert camera["t_depth"] == pytest.approx([0.004, 0.036, 0.1, 0.219], abs=1e-6)
    assert camera.attributes["depth_scale"] == 1 / 5000
    assert run.groups[""].attributes["start_unix"] == START
    assert run.report.missing == {"depth partner": 1}
    assert run.report.format == "tum_rgbd"


def test_association_gives_away_the_nearest_first() -> None:
    """On random cases the nearest two are a pair, none is used twice, and nothing that could be paired is left."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        color, depth = np.sort(rng.uniform(0, 0.1, 4)), np.sort(rng.uniform(0, 0.1, 4))
        pair = associate(color, depth, 0.02)
        used = pair[pair >= 0]
        assert len(set(used.tolist())) == len(used)
        gaps = np.abs(color[pair >= 0] - depth[used])
        assert (gaps <= 0.02).all()
        best = min(abs(color[i] - depth[order[i]]) for order in permutations(range(4)) for i in range(4))
        assert len(gaps) == 0 if best > 0.02 else gaps.min() == best
        free_color, free_depth = color[pair < 0], np.delete(depth, used)
        assert not (np.abs(free_color[:, None] - free_depth) <= 0.02).any()


def test_association_does_not_depend_on_a_common_shift() -> None:
    """Wall-clock stamps give the same pairs as stamps from zero."""
    rng = np.random.default_rng(1)
    color, depth = np.cumsum(rng.uniform(0.02, 0.05, 30)), np.cumsum(rng.uniform(0.02, 0.05, 30))
    assert associate(color, depth, 0.02).tolist() == associate(color + 1024.0, depth + 1024.0, 0.02).tolist()


def test_poses_of_the_camera_are_kept_as_unit_quaternions(tmp_path: Path) -> None:
    """groundtruth.txt becomes position and xyzw quaternion of length exactly 1; it may be absent."""
    poses = "# comment\n" + "\n".join(f"{START + i} 1 2 {i} 0 0 0.6 0.80001" for i in range(3))
    run = import_source(write_tum_folder(tmp_path / "desk", stamps(0, 1), stamps(0, 1), poses=poses), robot=ROBOT)
    assert_run_layout(run.groups)
    pose = run.groups["camera_pose"]
    assert pose["p_WC"].tolist() == [[1, 2, 0], [1, 2, 1], [1, 2, 2]]
    assert np.linalg.norm(pose["q_WC"], axis=1) == pytest.approx(np.ones(3), abs=1e-15)
    assert pose["q_WC"][0] == pytest.approx([0, 0, 0.6, 0.8], abs=1e-4)
    run = import_source(write_tum_folder(tmp_path / "bare", stamps(0, 1), stamps(0, 1)), robot=ROBOT)
    assert "camera_pose" not in run.groups


def test_stamps_that_do_not_rise_are_left_out_and_counted(tmp_path: Path) -> None:
    """A line that repeats or precedes an earlier stamp is left out with a warning."""
    root = write_tum_folder(tmp_path / "desk", stamps(0.0, 0.1, 0.2), stamps(0.0, 0.1, 0.2))
    lines = (root / "rgb.txt").read_text().splitlines()
    (root / "rgb.txt").write_text("\n".join([*lines, lines[2], lines[1]]) + "\n")
    run = import_source(root, robot=ROBOT)
    assert len(run.groups["camera"]["t"]) == 3
    assert any(warning.startswith("2 lines of rgb.txt") for warning in run.report.warnings)


@pytest.mark.parametrize(
    ("file", "line"),
    [
        ("rgb.txt", "1305031102.5"),
        ("rgb.txt", "1305031102.5 rgb/a b.png"),
        ("rgb.txt", "abc rgb/0.png"),
        ("rgb.txt", "nan rgb/0.png"),
        ("rgb.txt", "1_305031102.5 rgb/0.png"),
        ("rgb.txt", "1305031102.5 ../../secret.png"),
        ("rgb.txt", "1305031102.5 /etc/hostname"),
        ("rgb.txt", "1305031102.5 rgb/absent.png"),
        ("rgb.txt", "1305031102.5 rgb"),
        ("depth.txt", "1305031102.5 rgb/1305031102.000000.png"),
        ("groundtruth.txt", "1305031102.5 0 0 0 0 0 0"),
        ("groundtruth.txt", "1305031102.5 0 0 0 0 0 0 2"),
        ("groundtruth.txt", "1305031102.5 0 0 inf 0 0 0 1"),
        ("groundtruth.txt", "1205031102.5 0 0 0 0 0 0 1"),
    ],
)
def test_a_broken_line_is_refused(tmp_path: Path, file: str, line: str) -> None:
    """Every broken line ends in an error that names the list or the image."""
    poses = f"{START} 0 0 0 0 0 0 1\n"
    root = write_tum_folder(tmp_path / "desk", stamps(0.0), stamps(0.0), poses=poses)
    with (root / file).open("a") as target:
        target.write(line + "\n")
    assert str(root) in refusal(root).where


def test_an_empty_list_and_swapped_lists_are_refused(tmp_path: Path) -> None:
    """A list of comments has no image; depth images in rgb.txt are recognised by their headers."""
    root = write_tum_folder(tmp_path / "desk", stamps(0.0), stamps(0.0))
    color, depth = (root / "rgb.txt").read_text(), (root / "depth.txt").read_text()
    (root / "rgb.txt").write_text("# nothing\n")
    assert "no image" in refusal(root).what
    (root / "rgb.txt").write_text(depth)
    (root / "depth.txt").write_text(color)
    assert "swapped" in refusal(root).what


def test_real_tum_frame_passes_the_header_checks(tmp_path: Path, real_dir: Path) -> None:
    """The real fr3 frame is 640 x 480, 8-bit colour and 16-bit depth."""
    root = tmp_path / "fr3"
    root.mkdir()
    for kind, name in (("rgb", "color"), ("depth", "depth")):
        (root / f"{kind}.png").write_bytes((real_dir / "rgbd" / f"{name}.png").read_bytes())
        (root / f"{kind}.txt").write_text(f"{START} {kind}.png\n")
    (tmp_path / "fr3.toml").write_text('robot = "sample"\nsource = "TUM fr3"\nnature = "measured"\n')
    camera = import_source(root, robot=ROBOT).groups["camera"]
    assert (camera.attributes["width"], camera.attributes["height"]) == (640, 480)
