"""The hidden world of a set, made again from its label, and one more gait in it."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.blind import follow, labels
from r2s2r_cli.blind.guard import Peeked
from r2s2r_cli.blind.index import digest
from r2s2r_cli.blind.make.again import world_of
from r2s2r_cli.blind.make.bank import Asked, make, sealed, write_set
from r2s2r_cli.blind.make.follow import drive_later
from r2s2r_cli.blind.make.one import label, make_set
from r2s2r_cli.blind.make.worlds import Hidden, hidden
from r2s2r_cli.blind.make.write import robot_text
from r2s2r_cli.blind.run import jobs, left, run
from r2s2r_cli.blind.score import score
from r2s2r_cli.blind.sets import read_set
from r2s2r_cli.blind.split import Bank, Kind
from r2s2r_cli.errors import InputError
from schemas.robot import Robot
from tests.commands.conftest import invoke
from tests.support.blind_follow import TARGETS

SEED = 1_305
"""Of a world whose camera has 2 mm of noise, ten times a second."""
FIRST = 28
"""The same of a bank that begins so late."""


def labelled(world: Hidden) -> dict[str, Any]:
    """Its label, as it is opened."""
    found: dict[str, Any] = json.loads(json.dumps(label(world, [], None, 0)))
    return found


@pytest.mark.parametrize(
    "asked",
    [
        {"kind": Kind.NONE},
        {"kind": Kind.SINGLE},
        {"kind": Kind.SINGLE, "effects": ("tendon_set",)},
        {"kind": Kind.SINGLE, "effects": ("sensor_bias",), "gaits": 4},
        {"kind": Kind.PAIR, "gaits": 2},
        {"kind": Kind.PAIR, "noise_m": 0.001},
        {"kind": Kind.OUTSIDE, "commissioning": 1},
        {"kind": Kind.OUTSIDE, "tier": "A", "gaits": 3},
    ],
)  # fmt: skip
def test_a_world_comes_back_from_its_label(asked: dict[str, Any]) -> None:
    """What is in no label as well: offsets of the day, and what the maker was told. A label with another number is of
    no world."""
    world = hidden(Bank.REGRESSION, SEED, **asked)
    said = labelled(world)
    again = world_of(said, where="a label")
    assert np.array_equal(again.day, world.day) and replace(again, day=world.day) == world
    with pytest.raises(InputError, match="cannot be made again"):
        world_of({**said, "friction": said["friction"] + 1e-9}, where="a label")


def test_a_set_is_there_as_a_whole_or_not_at_all(tmp_path: Path) -> None:
    """A maker that breaks off leaves neither set nor label, and what it left half written is gone the next time."""
    key = labels.new_key(tmp_path / "a.key")

    def makes(folder: Path, broken: bool = False) -> dict[str, Any]:
        folder.mkdir(parents=True)
        (folder / ("half" if broken else "whole")).write_text("")
        if broken:
            raise KeyboardInterrupt
        return {"kind": "none"}

    with pytest.raises(KeyboardInterrupt):
        write_set(tmp_path, "a", key, lambda folder: makes(folder, broken=True))
    assert not (tmp_path / "sets" / "a").exists() and not sealed(tmp_path, "a").exists()
    write_set(tmp_path, "a", key, makes)
    assert sealed(tmp_path, "a").exists()
    assert [one.relative_to(tmp_path / "sets").as_posix() for one in (tmp_path / "sets").rglob("*")] == ["a", "a/whole"]


def log(folder: Path, world: Hidden, which: str, seed: int = 0) -> bytes:
    """Of one more gait."""
    robot = Robot.model_validate(tomllib.loads(robot_text(world.tolerance)))
    drive_later(world, robot, which, TARGETS, folder / f"{which}-{seed}", observed=0, seed=seed)
    return (folder / f"{which}-{seed}" / "f1.csv").read_bytes()


@pytest.mark.slow
def test_the_world_made_again_gives_the_same_logs(tmp_path: Path) -> None:
    """To the last byte: gaits of the set, and the one that follows."""
    world = hidden(Bank.REGRESSION, SEED, Kind.SINGLE, effects=("camera_pose",), gaits=2, commissioning=0)
    said = json.loads(json.dumps(make_set(world, tmp_path / "one", oracle=False)))
    again = world_of(said, where="a label")
    make_set(again, tmp_path / "two", oracle=False)
    assert digest(tmp_path / "one") == digest(tmp_path / "two")
    assert log(tmp_path / "one", world, "suggested") == log(tmp_path / "two", again, "suggested")


@pytest.mark.slow
def test_the_two_gaits_differ_in_their_targets_and_noise(tmp_path: Path) -> None:
    """Both begin at one place; the suggested one does what was asked for, fractions included; another seed, another
    place."""
    world = hidden(Bank.REGRESSION, SEED, Kind.NONE, gaits=2)
    logs = {one: table(log(tmp_path, world, *one)) for one in (("suggested", 0), ("random", 0), ("suggested", 1))}
    suggested, random, other = (logs[one] for one in logs)
    rows, first = np.unique(suggested["target"], axis=0, return_index=True)
    assert rows[np.argsort(first)].tolist() == [[1.0] * 6, TARGETS[0]]
    steps = np.abs(np.diff(random["target"], axis=0)).sum(axis=1)
    assert set(np.unique(random["target"])) <= {0.0, 1.0} and (steps[steps > 0] >= 2).all() and (steps > 0).sum() == 2
    begins = {one: np.nanmean(found["caps"][:5], axis=0) for one, found in logs.items()}
    apart = np.abs(begins["suggested", 0] - begins["random", 0])
    assert 0 < apart.max() < 6 * world.noise_m < np.abs(begins["suggested", 0] - begins["suggested", 1]).max()
    assert not np.array_equal(suggested["length"][:5], random["length"][:5]) and len(other["length"]) > 5


def table(text: bytes) -> dict[str, np.ndarray]:
    """Columns of a log: caps at frames, targets and lengths at rows."""
    head, *lines = text.decode().splitlines()
    names, values = head.split(","), np.array([[float(x) for x in line.split(",")] for line in lines])
    part = {what: values[:, [i for i, one in enumerate(names) if one.startswith(what)]]
            for what in ("cap", "target", "length")}  # fmt: skip
    return {**part, "caps": part["cap"][np.isfinite(part["cap"]).all(axis=1)]}


@pytest.fixture(scope="module")
def trial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One set of four gaits and verdicts that ask for one more, followed up by the command."""
    home = tmp_path_factory.mktemp("follow")
    key = labels.new_key(home / "a.key")
    list(make(Asked(Bank.REGRESSION, 1, home / "bank", key, FIRST, 0, gaits=4, oracle=False)))
    list(run(jobs(home / "bank", home / "verdicts", diagnoser="tests.support.blind_follow:asks")))
    assert followed(home)["done"] == 1
    return home


def followed(home: Path) -> dict[str, Any]:
    """What the command says."""
    result = invoke("blind", "follow", str(home / "bank"), "--verdicts", str(home / "verdicts"), "--key",
                    str(home / "a.key"), "--out", str(home / "out"), "--json", "--quiet")  # fmt: skip
    assert result.exit_code == 0, result.stderr
    found: dict[str, Any] = json.loads(result.stdout)
    return found


@pytest.mark.slow
def test_the_suggested_gait_is_run_and_diagnosed(trial: Path) -> None:
    """This diagnoser is sure once it has seen what it asked for, and not after a gait by chance."""
    (name,) = [path.stem for path in (trial / "verdicts").iterdir()]
    kept = json.loads((trial / "out" / f"{name}.json").read_text())
    assert kept["suggested"]["named"] == ["payload"] and kept["random"]["verdict"] == "ambiguous"
    assert followed(trial)["followed"] == [
        {"set": name, "gait": "reversals", "suggested": "effect payload", "random": "ambiguous"}
    ]


@pytest.mark.slow
def test_a_grown_set_is_the_old_one_and_one_more_run(trial: Path) -> None:
    """Old files are as they were; the new run is fitted, after the others, and the judged gait stays the one judged."""
    (name,) = [path.stem for path in (trial / "verdicts").iterdir()]
    old = trial / "bank" / "sets" / name
    before = read_set(old)
    for which in follow.BANKS:
        new = trial / "out" / which / "sets" / name
        files = {one.relative_to(new).as_posix(): one.read_bytes() for one in new.rglob("*") if one.is_file()}
        for one in old.rglob("*"):
            assert one.is_dir() or files.pop(one.relative_to(old).as_posix()) == one.read_bytes()
        assert sorted(files) == ["follow/f1.csv", "follow/f1.toml"]
        evidence = read_set(new)
        assert [run.name for run in evidence.runs] == ["g1", "g2", "g3", "g4", "f1"]
        assert evidence.judge == before.judge and evidence.fit[:-1] == before.fit and evidence.fit[-1].run == "f1"


@pytest.mark.slow
def test_the_grown_banks_are_banks(trial: Path) -> None:
    """Listed and sealed as any: `blind score` opens them with the same key, and the truth in them is the old one."""
    key = labels.read_key(trial / "a.key")
    (name,) = [path.stem for path in (trial / "verdicts").iterdir()]
    for which in follow.BANKS:
        result = score(trial / "out" / which, trial / "out" / "verdicts" / which, key)
        assert (result.sets, result.scored, result.failed) == (1, 1, 0)
        index = json.loads((trial / "out" / which / "index.json").read_text())
        sealed = (trial / "out" / which / "labels" / f"{name}.sealed").read_bytes()
        said = labels.opened(sealed, key, index["sets"][name]["label"], where=name)
        assert said.pop("follow") == {"gait": which, "seed": 0}
        old = json.loads((trial / "bank" / "index.json").read_text())["sets"][name]["label"]
        assert said == labels.opened((trial / "bank" / "labels" / f"{name}.sealed").read_bytes(), key, old, where=name)


@pytest.mark.slow
def test_what_is_there_is_not_done_again(trial: Path) -> None:
    """A verdict that is gone comes back alone; neither list nor logs are made anew."""
    (name,) = [path.stem for path in (trial / "verdicts").iterdir()]
    out = trial / "out"
    listed = {which: digest(out / which) for which in follow.BANKS}
    other = (out / "verdicts" / "random" / f"{name}.json").stat().st_mtime_ns
    (out / "verdicts" / "suggested" / f"{name}.json").unlink()
    (out / f"{name}.json").unlink()
    assert followed(trial)["done"] == 1 and (out / f"{name}.json").exists()
    assert (out / "verdicts" / "random" / f"{name}.json").stat().st_mtime_ns == other
    assert {which: digest(out / which) for which in follow.BANKS} == listed


@pytest.mark.slow
def test_who_diagnoses_a_grown_set_is_watched(trial: Path, tmp_path: Path) -> None:
    """One that reaches for the labels of the grown bank has no verdict."""
    whole = follow.trial(trial / "bank", trial / "verdicts")
    peeking = replace(whole, asked={"diagnoser": "tests.support.blind_diagnosers:peeks", "settings": {}})
    todo = tuple(replace(job, out=tmp_path / job.bank.name) for job in follow.jobs(peeking, trial / "out"))
    with pytest.raises(Peeked):
        list(follow.run(peeking, trial / "out", todo))
    assert len(todo) == 2 and left(todo) == todo


@pytest.mark.slow
def test_logs_that_were_changed_are_not_followed(trial: Path, tmp_path: Path) -> None:
    """The maker begins with what the bank was closed with, or not at all."""
    (path,) = (trial / "bank" / "sets").glob("*/gaits/g1.csv")
    text = path.read_text()
    path.write_text(text.replace("0", "1", 1))
    try:
        result = invoke("blind", "follow", str(trial / "bank"), "--verdicts", str(trial / "verdicts"), "--key",
                        str(trial / "a.key"), "--out", str(tmp_path / "out"), "--json", "--quiet")  # fmt: skip
    finally:
        path.write_text(text)
    assert result.exit_code == 4 and "closed with" in json.loads(result.stdout)["what"]
    assert not list((tmp_path / "out").rglob("*.csv"))
