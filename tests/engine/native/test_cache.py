"""Kernels on disk: found again by another process, never taken for another's, never trusted when damaged."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine.native import NativeStep, cache

ARGUMENTS = (
    torch.ones(1, 2, dtype=torch.float64), torch.ones(1, 3, 1, dtype=torch.float64),
    torch.full((1, 1), 0.5, dtype=torch.float64),
)  # fmt: skip

PROGRAM = """
import torch
from pathlib import Path
from r2s2r_cli.engine.native import NativeStep

def fn(s, u, p, h):
    if {forbid}:
        raise AssertionError("traced")
    return s + h * u * p

step = NativeStep(fn, 2, 1, 1, key="k", cache_dir=Path({directory!r}))
given = torch.ones(1, 2).double(), torch.ones(1, 3, 1).double(), torch.full((1, 1), 0.5).double()
frames = step.forward(*given, h=0.1)
adjoint = step.vjp(*given, torch.ones(1, 4, 2).double(), h=0.1)[2]
tangent = step.jvp(*given, dp=torch.ones(1, 1, 1).double(), h=0.1)[1]
print([b.from_cache for b in step.build_log], round(frames[0, 3, 0].item(), 9), round(adjoint.item(), 9),
      round(tangent[0, 3, 0, 0].item(), 9))
"""


def kernels(directory: Path | None, key: str = "k", factor: float = 1.0) -> NativeStep:
    """A small step function whose kernels are kept in a directory."""

    def fn(s: Tensor, u: Tensor, p: Tensor, h: Tensor) -> Tensor:
        return s + factor * h * u * p

    return NativeStep(fn, 2, 1, 1, key=key, cache_dir=directory)


def last(step: NativeStep) -> float:
    """The first coordinate after three steps of 0.1 s."""
    return step.forward(*ARGUMENTS, h=0.1)[0, 3, 0].item()


def test_a_kernel_from_disk_is_not_traced(tmp_path: Path) -> None:
    """Where a kernel is on disk the step function is not called, not even once."""

    def forbidden(*_: Tensor) -> Tensor:
        raise AssertionError("traced")

    assert last(kernels(tmp_path)) == pytest.approx(1.15)
    step = NativeStep(forbidden, 2, 1, 1, key="k", cache_dir=tmp_path)
    assert last(step) == pytest.approx(1.15)
    assert step.build_log[0].from_cache


@pytest.mark.slow
def test_a_second_process_neither_traces_nor_compiles(tmp_path: Path) -> None:
    """What one process compiled, the next loads: all three kernels, with the same results, without calling the step."""
    said = []
    for forbid in (False, True):
        code = PROGRAM.format(forbid=forbid, directory=str(tmp_path))
        said.append(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
    # d/dp of 1 + 3 h p is 0.3; the sum over frames of both coordinates 2 h (1 + 2 + 3).
    assert said[0].split("]")[1].split() == ["1.15", "1.2", "0.3"]
    assert said[1] == said[0].replace("False, False, False", "True, True, True")


def test_another_key_is_another_kernel(tmp_path: Path) -> None:
    """Kernels are found by key alone: the same key gives the old code, another key new code."""
    assert last(kernels(tmp_path)) == pytest.approx(1.15)
    assert last(kernels(tmp_path, factor=2.0)) == pytest.approx(1.15)
    other = kernels(tmp_path, key="other", factor=2.0)
    assert last(other) == pytest.approx(1.3)
    assert not other.build_log[0].from_cache


def test_another_type_and_width_are_other_kernels(tmp_path: Path) -> None:
    """One file each for one environment, for lanes, and for each type."""
    step = kernels(tmp_path)
    last(step)
    step.forward(*(x.expand(2, *x.shape[1:]) for x in ARGUMENTS), h=0.1)
    step.forward(*(x.float() for x in ARGUMENTS), h=0.1)
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.parametrize("damage", ["cut", "flip", "foreign", "empty"])
def test_a_damaged_file_is_compiled_again(tmp_path: Path, damage: str) -> None:
    """A file that is cut off, changed, empty or something else is replaced by a good one."""
    last(kernels(tmp_path))
    (path,) = tmp_path.iterdir()
    good = path.read_bytes()
    changed = {"cut": good[:-9], "flip": good[:-9] + b"!" + good[-8:], "foreign": b"\x7fELF" + good, "empty": b""}
    path.write_bytes(changed[damage])
    step = kernels(tmp_path)
    assert last(step) == pytest.approx(1.15)
    assert not step.build_log[0].from_cache
    again = kernels(tmp_path)
    assert last(again) == pytest.approx(1.15)
    assert again.build_log[0].from_cache


def test_a_directory_that_cannot_be_written_costs_speed_only(tmp_path: Path) -> None:
    """Where no file can be made (here: a file is in the way) kernels are compiled and used all the same."""
    blocked = tmp_path / "file"
    blocked.write_text("no directory")
    assert last(kernels(blocked / "cache")) == pytest.approx(1.15)
    assert blocked.read_text() == "no directory"


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_directory_costs_speed_only(tmp_path: Path) -> None:
    """The same for a directory without permission."""
    tmp_path.chmod(0o500)
    assert last(kernels(tmp_path)) == pytest.approx(1.15)
    assert not list(tmp_path.iterdir())


def test_an_interrupted_write_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A write that fails before the end leaves neither a kernel nor a temporary file."""

    def fails(*_: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(Path, "replace", fails)
    cache.write(tmp_path / "a.kernel", {}, b"code")
    assert not list(tmp_path.iterdir())


def test_object_code_comes_back_as_it_was(tmp_path: Path) -> None:
    """Whatever bytes it has: ends of lines, zeros, none."""
    for code in (b"\nkernel\n\0called\n", b""):
        cache.write(tmp_path / "a.kernel", {"operations": 3}, code)
        assert cache.read(tmp_path / "a.kernel") == ({"operations": 3}, code)


def test_the_name_depends_on_all_that_the_code_depends_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Another processor, or another source of this package, is another file."""
    names = {cache.file_name("a", 1), cache.file_name("a", 2)}
    cache.source_hash.cache_clear()
    monkeypatch.setattr("r2s2r_cli.engine.native.machine.host", lambda: ("another", "+features"))
    names.add(cache.file_name("a", 1))
    cache.source_hash.cache_clear()
    assert len(names) == 3


def test_without_directory_nothing_is_kept() -> None:
    """The log tells what each kernel took; without a directory none comes from disk."""
    step = kernels(None)
    last(step)
    last(step)
    assert [(b.kind, b.from_cache) for b in step.build_log] == [("forward", False)]
    assert step.build_log[0].operations > 0
