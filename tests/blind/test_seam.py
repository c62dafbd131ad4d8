"""Independent work through one seam, whoever does it."""

import itertools
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from r2s2r_cli.blind.seam import each, open_executor
from r2s2r_cli.blind.verdict import write_document
from r2s2r_cli.errors import InputError, UsageError

ROOT = Path(__file__).parents[2]


def test_all_is_done_and_little_is_handed_out() -> None:
    """Every item once, with its own result; never more under way than asked for."""
    handed: list[int] = []

    def square(x: int) -> int:
        handed.append(x)
        return x * x

    with ThreadPoolExecutor(4) as pool:
        found = {}
        for item, result in each(pool, square, range(20), at_once=3):
            found[item] = result
            assert len(handed) <= len(found) + 3
    assert found == {x: x * x for x in range(20)}


def test_an_error_comes_back_whole_from_another_process() -> None:
    """Ours have keyword arguments, with which pickling alone would break the pool."""
    with open_executor("local", 1) as pool, pytest.raises(InputError) as caught:
        list(each(pool, refuse, ["x.csv"], at_once=1))
    assert caught.value.where == "x.csv" and caught.value.hint == "look" and caught.value.expected == "y"


def refuse(name: str) -> None:
    """Says no."""
    raise InputError("no", where=name, expected="y", received="n", hint="look")


@pytest.mark.skipif(sys.platform != "linux", reason="processes are looked up in /proc")
def test_workers_end_with_who_asked_them(tmp_path: Path) -> None:
    """Killed without a chance to say so: a worker that would go on for minutes is gone too."""
    told = tmp_path / "pid"
    script = f"from tests.blind.test_seam import hand_out; hand_out({str(told)!r})"
    with subprocess.Popen([sys.executable, "-c", script], cwd=ROOT) as asker:
        assert until(told.exists)
        asker.kill()
    worker = int(told.read_text())
    assert until(lambda: gone(worker))


def hand_out(name: str) -> None:
    """One piece of work that never ends, to one worker; what a process of the test above runs."""
    with open_executor("local", 1) as pool:
        list(each(pool, linger, [name], at_once=1))


def linger(name: str) -> None:
    """Says who it is, then works for longer than any test."""
    scratch = Path(f"{name}.part")
    scratch.write_text(str(os.getpid()))
    scratch.rename(name)
    time.sleep(600)


def until(true: Callable[[], bool], seconds: float = 60.0) -> bool:
    """Whether it comes true in time."""
    end = time.monotonic() + seconds
    while not true() and time.monotonic() < end:
        time.sleep(0.05)
    return true()


def gone(pid: int) -> bool:
    """Whether no such process is there, or only its exit status is."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except OSError:
        return True


@pytest.mark.skipif(sys.platform != "linux", reason="processes are looked up in /proc")
@pytest.mark.parametrize("all_of_them", [False, True])
def test_an_interrupt_ends_what_is_under_way(tmp_path: Path, all_of_them: bool) -> None:
    """Told alone, or with its workers as a terminal tells them: who asked ends at once, they do before it, and nobody
    says where it was; what they wrote is whole."""
    script = f"from tests.blind.test_seam import hand_out_scribbling; hand_out_scribbling({str(tmp_path)!r})"
    with subprocess.Popen(
        [sys.executable, "-c", script], cwd=ROOT, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as asker:
        assert asker.stderr is not None
        assert until(lambda: len(list(tmp_path.glob("*-1.json"))) == 2)
        begun = time.monotonic()
        if all_of_them:
            os.killpg(asker.pid, signal.SIGINT)
        else:
            asker.send_signal(signal.SIGINT)
        said = asker.stderr.read()  # to its end, so that no worker can say anything later
        assert asker.wait(60) == 130 and time.monotonic() - begun < 10
    workers = {int(path.name.split("-")[0]) for path in tmp_path.iterdir()}
    assert len(workers) == 2 and all(map(gone, workers)) and said == ""
    assert not [path for path in tmp_path.iterdir() if path.suffix != ".json"]
    assert all(f"-{json.loads(path.read_text())['number']}.json" in path.name for path in tmp_path.iterdir())


def hand_out_scribbling(folder: str) -> None:
    """Two pieces of work that write without end, to two workers; what a process of the test above runs."""
    try:
        with open_executor("local", 2) as pool:
            list(each(pool, scribble, [folder, folder], at_once=2))
    except KeyboardInterrupt:
        sys.exit(130)


def scribble(folder: str) -> None:
    """Verdicts to a disk so slow that an interrupt falls between writing one and giving it its name."""
    named = Path.replace

    def slow(part: Path, path: Path) -> Path:
        time.sleep(0.3)
        return named(part, path)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Path, "replace", slow)
        for i in itertools.count():
            write_document(Path(folder) / f"{os.getpid()}-{i}.json", {"number": i})
            time.sleep(0.05)  # a diagnosis


def test_another_address_is_refused() -> None:
    """With what is known."""
    with pytest.raises(UsageError, match="no such executor"), open_executor("slurm://x", 1):
        pass


@pytest.mark.slow
def test_two_workers_of_dask_do_the_same() -> None:
    """A scheduler on this machine with two workers; needs the extra `cluster`, and is left out without it."""
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=False, dashboard_address=None, protocol="tcp"
        ) as cluster,
        open_executor(cluster.scheduler_address.replace("tcp://", "dask://"), 1) as pool,
    ):
        found = dict(each(pool, doubled, range(6), at_once=2))
        with pytest.raises(InputError, match="no"):
            list(each(pool, refuse, ["x.csv"], at_once=1))
    assert found == {x: 2 * x for x in range(6)}


def doubled(x: int) -> int:
    """Twice as much."""
    return 2 * x
