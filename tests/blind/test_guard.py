"""Whoever reaches for the truth while a set is diagnosed is stopped; each time in a process of its own."""

import subprocess
import sys
from pathlib import Path

import pytest

_HEAD = """
import os, sys
from pathlib import Path
from r2s2r_cli.blind.guard import Guard, Peeked
bank = Path(sys.argv[1])
guard = Guard(bank)
guard.install()
open(bank / "labels" / "a.sealed").close()  # before a set is begun nothing is shut
guard.begin(bank / "sets" / "a")
"""


@pytest.fixture(scope="module")
def bank(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sets, their labels, and a world beside the bank."""
    folder = tmp_path_factory.mktemp("bank") / "bank"
    for name in ("a", "b"):
        (folder / "sets" / name).mkdir(parents=True)
        (folder / "sets" / name / "robot.toml").write_text("x = 1\n")
        (folder / "labels").mkdir(exist_ok=True)
        (folder / "labels" / f"{name}.sealed").write_text("secret")
    (folder.parent / "world-1.toml").write_text("seed = 1\n")
    (folder.parent / "trial.key").write_text("key")
    (folder.parent / "way").symlink_to(folder / "labels")
    return folder


def answer(bank: Path, code: str) -> subprocess.CompletedProcess[str]:
    """What a diagnoser that runs `code` ends with."""
    return subprocess.run([sys.executable, "-c", _HEAD + code, str(bank)], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    "peek",
    [
        "open(bank / 'labels' / 'a.sealed')",
        "(bank / 'sets' / 'b' / 'robot.toml').read_text()",
        "open(bank.parent / 'world-1.toml')",
        "open(bank.parent / 'trial.key', 'rb')",
        "open(bank.parent / 'way' / 'a.sealed')",
        "os.listdir(bank / 'labels')",
        "import r2s2r_cli.rig.plant",
        "import r2s2r_cli.blind.make.worlds",
        "os.system('cat ' + str(bank / 'labels' / 'a.sealed'))",
        "os.chdir(bank / 'labels'); open('a.sealed')",
    ],
)  # fmt: skip
def test_a_planted_peek_is_stopped(bank: Path, peek: str) -> None:
    """Label, another set, world, key, a way round by a link, a listing, the rig, the maker, another process."""
    found = answer(bank, peek)
    assert found.returncode == 1 and "Peeked: reached for" in found.stderr and "secret" not in found.stdout


def test_a_peek_that_is_hushed_up_spoils_the_verdict(bank: Path) -> None:
    """Catching the refusal does not help: the end of the set says it again."""
    code = "try:\n    open(bank / 'labels' / 'a.sealed')\nexcept BaseException:\n    pass\nguard.end()"
    found = answer(bank, code)
    assert found.returncode == 1 and "Peeked: reached for" in found.stderr


def test_its_own_set_and_the_library_are_open(bank: Path) -> None:
    """What a diagnosis needs is given, and counted."""
    code = "(bank / 'sets' / 'a' / 'robot.toml').read_text()\nimport wave, numpy\nguard.end()\nprint(guard.opened > 2)"
    found = answer(bank, code)
    assert found.returncode == 0 and found.stdout.strip() == "True", found.stderr
