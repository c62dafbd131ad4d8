"""Sets with pictures instead of caps: made by the maker, read through our own tracker, judged as every other set."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.blind import labels
from r2s2r_cli.blind.index import read_index
from r2s2r_cli.blind.make import one as maker
from r2s2r_cli.blind.make.again import world_of
from r2s2r_cli.blind.make.bank import Asked, make, sealed, worlds, write_list, write_set
from r2s2r_cli.blind.make.drive import Driven, drive, random_gait
from r2s2r_cli.blind.make.one import label, make_set
from r2s2r_cli.blind.make.worlds import hidden
from r2s2r_cli.blind.recorded import read_recording
from r2s2r_cli.blind.run import jobs, run
from r2s2r_cli.blind.score import score
from r2s2r_cli.blind.sets import read_set
from r2s2r_cli.blind.split import Bank, Kind
from r2s2r_cli.errors import InputError, UsageError
from tests.commands.conftest import invoke

SEED = 1_305
NAME = "aaaaaaaaaaaa"
STREAMS = {
    "": set(), "commands": {"t", "target", "control"}, "sensors": {"t", "length", "cable"},
    "intervals": {"first", "last", "t_first", "t_last", "target", "complete"},
    "segments": {"interval", "first", "last", "t_first", "t_last", "direction", "complete"},
    "camera": {"t", "t_depth", "pair", "X_WC"},
}  # fmt: skip
FACTS = {"origin", "nature", "source", "robot", "pid_p", "pid_i", "pid_d", "pid_tolerance", "pid_min_length",
         "pid_range"}  # fmt: skip


def test_a_label_says_that_there_are_pictures_and_its_world_comes_back() -> None:
    """What the noise is the tracker says; labels of before know of no camera and are of worlds without."""
    world = hidden(Bank.REGRESSION, SEED, Kind.SINGLE, effects=("camera_delay",), gaits=2, camera=True)
    said: dict[str, Any] = json.loads(json.dumps(label(world, [], None, 0)))
    assert said["camera"] and said["noise_m"] is None and said["ar1"] is None and said["rate_hz"] == 10.0
    again = world_of(said, where="a label")
    assert replace(again, day=world.day) == world
    plain = hidden(Bank.REGRESSION, SEED, Kind.NONE)
    old = json.loads(json.dumps(label(plain, [], None, 0)))
    assert not old.pop("camera") and not world_of(old, where="a label").camera
    with pytest.raises(InputError, match="cannot be made again"):
        world_of({**said, "camera": False}, where="a label")


def test_sets_of_both_kinds_never_lie_in_one_folder(tmp_path: Path) -> None:
    """Names come from the key alone: a bank of caps is not gone on with as one of pictures."""
    key = labels.new_key(tmp_path / "a.key")
    asked = Asked(Bank.REGRESSION, 1, tmp_path, key, camera=True)
    (world,) = worlds(asked)
    assert world.camera
    path = sealed(tmp_path, labels.set_name(key, 0))
    path.parent.mkdir()
    path.write_bytes(labels.seal({"seed": world.seed, "observed": 0}, key)[0])
    with pytest.raises(UsageError, match="another bank") as caught:
        list(make(asked))
    assert "in pictures" in str(caught.value.expected) and "in caps" in str(caught.value.received)


def test_our_own_engine_has_no_camera(tmp_path: Path) -> None:
    """Exit code 2, and no key."""
    result = invoke("blind", "make", str(tmp_path / "b"), "--key", str(tmp_path / "a.key"), "--camera", "--tier", "A",
                    "--json")  # fmt: skip
    assert result.exit_code == 2 and "no camera" in json.loads(result.stdout)["what"]
    assert not (tmp_path / "a.key").exists()


def short_set(folder: Path, *, observed: int = 0) -> tuple[dict[str, Any], dict[str, Driven]]:
    """A set of two gaits of one target each, its label, and what really happened, by gait."""
    happened: dict[str, Driven] = {}

    def driven(*arguments: Any, **options: Any) -> Driven:
        found = drive(*arguments, **options)
        happened[found.gait.name] = found
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(maker, "drive", driven)
        patch.setattr(maker, "random_gait", lambda name, rng: random_gait(name, rng, count=1))
        world = hidden(Bank.REGRESSION, SEED, Kind.NONE, gaits=2, commissioning=0, camera=True)
        return make_set(world, folder, observed=observed, oracle=False), happened


@pytest.fixture(scope="module")
def bank(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bytes, dict[str, Driven]]:
    """A closed bank of one such set, its key, and the truth."""
    home = tmp_path_factory.mktemp("camera")
    key, happened = labels.new_key(home / "a.key"), {}

    def made(folder: Path) -> dict[str, Any]:
        said, found = short_set(folder)
        happened.update(found)
        return said

    write_set(home / "bank", NAME, key, made)
    write_list(home / "bank", key, [NAME], tier="B", bank="regression")
    return home / "bank", key, happened


@pytest.mark.slow
def test_the_tracker_finds_the_caps(bank: tuple[Path, bytes, dict[str, Driven]]) -> None:
    """Within millimetres of the truth, which only the test knows; commands as they were sent, lengths of all cables."""
    folder, _, happened = bank
    evidence = read_set(folder / "sets" / NAME)
    assert [found.name for found in evidence.runs] == list(happened) == ["g1", "g2"]
    for found in evidence.runs:
        caps, truth = found.caps, happened[found.name]
        flat = truth.caps.reshape(len(truth.t), -1)
        there = np.stack([np.interp(caps.t, truth.t, column) for column in flat.T], axis=-1).reshape(-1, 6, 3)
        off = np.linalg.norm(caps.observed - there, axis=-1)
        assert np.median(off) < 0.002 and np.quantile(off, 0.9) < 0.005
        assert np.linalg.norm(caps.p_WE - there, axis=-1).max() < 0.01
        assert np.array_equal(caps.t_command, truth.t) and not caps.sampled
        assert len(caps.intervals) == len(truth.starts) and found.lengths is not None
        assert np.array_equal(found.lengths.length, truth.length, equal_nan=True)
        assert 0 < np.median(caps.noise) < 0.002


@pytest.mark.slow
def test_no_truth_is_in_the_folder(bank: tuple[Path, bytes, dict[str, Driven]]) -> None:
    """A recording has the streams of a lab and no other; no number of the truth stands in its bytes."""
    folder, _, happened = bank
    place = folder / "sets" / NAME
    found = {one.relative_to(place).as_posix() for one in place.rglob("*") if one.is_file()}
    assert found == {"robot.toml", "gaits/g1.npz", "gaits/g2.npz"}
    for name, truth in happened.items():
        path = place / "gaits" / f"{name}.npz"
        groups = dict(read_recording(path).data.streams(name))
        assert {stream: set(group.datasets) for stream, group in groups.items()} == STREAMS
        assert set(groups[""].attributes) == FACTS
        data = path.read_bytes()
        assert not any(word in data for word in (b"world", b"seed", b"friction", str(SEED).encode() + b"\n"))
        some = [array[20].ravel() for array in (truth.p_WE, truth.caps, truth.sensed)]
        assert not any(number.tobytes() in data for number in np.concatenate(some))
        # Such a search finds what is there.
        assert truth.length[20, 0].tobytes() in data


@pytest.mark.slow
def test_another_draw_is_another_look_at_the_same_motion(
    bank: tuple[Path, bytes, dict[str, Driven]], tmp_path: Path
) -> None:
    """Commands, lengths and the camera's pose are the same, no picture is."""
    folder, _, _ = bank
    short_set(tmp_path / "again", observed=1)
    one, other = (read_recording(place / "gaits" / "g1.npz") for place in (folder / "sets" / NAME, tmp_path / "again"))
    groups = [dict(found.data.streams("g1")) for found in (one, other)]
    for stream, dataset in (("commands", "control"), ("sensors", "length")):
        assert np.array_equal(groups[0][stream][dataset], groups[1][stream][dataset], equal_nan=True)
    assert np.array_equal(groups[0]["camera"]["X_WC"], groups[1]["camera"]["X_WC"])
    for name in ("color", "depth"):
        a, b = one.pictures("g1", name), other.pictures("g1", name)
        assert a is not None and b is not None and min(len(a), len(b)) > 20
        assert not {a[k] for k in range(len(a))} & {b[k] for k in range(len(b))}


@pytest.mark.slow
def test_a_set_with_pictures_is_judged_and_scored(bank: tuple[Path, bytes, dict[str, Driven]], tmp_path: Path) -> None:
    """Under the guard: the tracker opens the files of the set and reaches for nothing else; the label is scored."""
    folder, key, _ = bank
    todo = jobs(folder, tmp_path / "verdicts", diagnoser="tests.support.blind_diagnosers:sees")
    (verdict,) = list(run(todo))
    assert verdict["failed"] is None and verdict["opened"] > 3 and not verdict["refused"]
    assert verdict["logs"] == read_index(folder / "index.json")[0]["sets"][NAME]["logs"]
    result = score(folder, tmp_path / "verdicts", key)
    assert result.scored == result.sets == 1 and result.failed == 0
