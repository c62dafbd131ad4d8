"""A whole trial: sets made in a process of their own, verdicts under guard, labels opened at the end."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from r2s2r_cli.blind import labels
from r2s2r_cli.blind.guard import Peeked
from r2s2r_cli.blind.run import Job, jobs, left, run
from r2s2r_cli.blind.score import score
from r2s2r_cli.blind.sets import read_set
from r2s2r_cli.errors import InputError

HERE = "tests.support.blind_diagnosers:"
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def bank(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sets of two gaits, made by the command."""
    home = tmp_path_factory.mktemp("trial")
    command = [sys.executable, "-m", "r2s2r_cli", "blind", "make", "bank", "--key", "a.key", "--bank", "regression",
               "--count", "2", "--gaits", "2", "--commissioning", "1", "--no-oracle", "--quiet"]  # fmt: skip
    made = subprocess.run(command, cwd=home, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    return home / "bank"


def all_jobs(bank: Path, out: Path, diagnoser: str = "sees", **options: object) -> tuple[Job, ...]:
    """Jobs of a diagnoser of the tests."""
    return jobs(bank, out, diagnoser=HERE + diagnoser, **options)


def test_a_set_holds_logs_and_nothing_else(bank: Path) -> None:
    """Robot, gaits, commissioning runs with sidecars; but for a tolerance all sets have the same words."""
    names = list(json.loads((bank / "index.json").read_text())["sets"])
    words = []
    for name in names:
        folder = bank / "sets" / name
        found = {one.relative_to(folder).as_posix() for one in folder.rglob("*") if one.is_file()}
        runs = {f"{part}.{end}" for part in ("gaits/g1", "gaits/g2", "commissioning/c1") for end in ("csv", "toml")}
        assert found == {"robot.toml", *runs}
        texts = [(folder / one).read_text().splitlines() for one in sorted(found) if one.endswith("toml")]
        words.append([[line for line in text if not line.startswith("tolerance")] for text in texts])
        assert int(name, 16) >= 0 and len(name) == 12
    assert len(names) == 2 and words[0] == words[1]
    assert not any(b"friction" in one.read_bytes() for one in (bank / "labels").iterdir())


def test_a_set_is_evidence(bank: Path) -> None:
    """Runs with caps, commands as they were sent, lengths of all cables; the last gait is judged."""
    name = all_jobs(bank, bank)[0].name
    evidence = read_set(bank / "sets" / name)
    assert [run.name for run in evidence.runs] == ["g1", "g2"] and [run.name for run in evidence.healthy] == ["c1"]
    assert [one.run for one in evidence.fit] == ["g1"] and [one.run for one in evidence.judge] == ["g2"]
    caps = evidence.runs[0].caps
    assert not caps.sampled and len(caps.t_command) > 1.5 * len(caps.t) and len(caps.intervals) == 6
    assert evidence.runs[0].lengths is not None and evidence.runs[0].lengths.length.shape[1] == 9
    mixed = read_set(bank / "sets" / name, shuffled=3).runs[0].caps
    assert (mixed.observed == caps.observed).all() and (mixed.control != caps.control).any()


def test_verdicts_are_resumed_and_scored(bank: Path, tmp_path: Path) -> None:
    """What is there is not done again; the score opens what was committed to, with the right key alone."""
    out = tmp_path / "verdicts"
    todo = all_jobs(bank, out)
    verdicts = list(run(todo))
    assert len(verdicts) == 2 and all(one["opened"] > 6 and not one["refused"] for one in verdicts)
    (out / f"{todo[0].name}.json").unlink()
    assert [job.name for job in left(todo)] == [todo[0].name]
    list(run(left(todo)))
    key = labels.read_key(bank.parent / "a.key")
    result = score(bank, out, key)
    assert result.scored == result.sets == 2 and result.failed == 0
    # A checkout with changes is told of, and where the suite runs there may be some.
    assert all("not committed" in words for words in result.warnings)
    with pytest.raises(InputError, match="cannot be opened"):
        score(bank, out, labels.new_key(tmp_path / "other.key"))
    agreed = {row.name: row for row in score(bank, out, key, again=out).rows}["same_verdict"]
    assert agreed.value == 1.0 and agreed.n == 2
    with pytest.raises(InputError, match="no second verdict"):
        score(bank, out, key, again=tmp_path / "none")
    with pytest.raises(InputError, match="answers another question"):
        left(all_jobs(bank, out, settings={"seed": 1}))


def test_a_diagnoser_that_peeks_has_no_verdict(bank: Path, tmp_path: Path) -> None:
    """One that opens the labels, and one that hushes it up."""
    for name in ("peeks", "peeks_quietly"):
        with pytest.raises(Peeked):
            list(run(all_jobs(bank, tmp_path / name, name)[:1]))
        assert not list(tmp_path.rglob("*.json"))


def test_a_bug_is_a_miss_and_not_the_end(bank: Path, tmp_path: Path) -> None:
    """Both sets have a verdict that says what broke; both count as failed."""
    verdicts = list(run(all_jobs(bank, tmp_path / "v", "breaks")))
    assert len(verdicts) == 2 and all("nothing to divide by" in one["failed"] for one in verdicts)
    assert score(bank, tmp_path / "v", labels.read_key(bank.parent / "a.key")).failed == 2


def test_logs_that_were_changed_are_refused(bank: Path, tmp_path: Path) -> None:
    """One digit in one log: neither run nor score goes on."""
    log = next((bank / "sets").rglob("g1.csv"))
    text = log.read_text()
    log.write_text(text.replace("0", "1", 1))
    try:
        with pytest.raises(InputError, match="closed with"):
            list(run(all_jobs(bank, tmp_path / "v")))
    finally:
        log.write_text(text)
