"""Tasks side by side: every one runs once, and an error or Ctrl-C ends them soon and safely."""

from __future__ import annotations

import gc
import threading
import weakref
from concurrent.futures import Future, wait as wait_for_all

import pytest
import torch
from torch import Tensor

from r2s2r_cli.engine.native import run_forward as forward_module, threads
from r2s2r_cli.engine.native.build import Builder
from r2s2r_cli.engine.native.schedule import Schedule


@pytest.mark.parametrize("n", [-1, 0, 1, 3, 10**6])
def test_every_task_runs_once(n: int) -> None:
    """However many threads are asked for, none or more than tasks included."""
    done: list[int] = []
    threads.spread(done.append, range(7), n)
    assert sorted(done) == list(range(7))


def test_an_interrupt_ends_the_helpers_with_the_task_in_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C reaches the caller alone: the helper finishes its task, and takes none of the many that are left."""
    caller, begun, waited_for = threading.current_thread(), threading.Event(), threading.Event()
    helped: list[int] = []

    def run(task: int) -> None:
        if threading.current_thread() is caller:
            assert begun.wait(60)
            raise KeyboardInterrupt
        helped.append(task)
        begun.set()
        assert waited_for.wait(60)

    def wait(futures: list[Future[None]]) -> None:
        waited_for.set()
        wait_for_all(futures)

    monkeypatch.setattr(threads, "wait", wait)
    with pytest.raises(KeyboardInterrupt):
        threads.spread(run, range(10_000), 2)
    assert len(helped) == 1


def test_arrays_live_as_long_as_their_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second Ctrl-C while helpers are waited for leaves them running: what they write to must still be there."""
    kept: list[object] = []
    frames: list[weakref.ref[Tensor]] = []

    def left_running(run: object, *_: object) -> None:
        kept.append(run)
        raise KeyboardInterrupt

    def new_empty(self: Tensor, *args: tuple[int, ...]) -> Tensor:
        made = self.new_zeros(*args)
        frames.append(weakref.ref(made))
        return made

    def fn(s: Tensor, u: Tensor, p: Tensor, h: Tensor) -> Tensor:
        return s + h * u * p

    monkeypatch.setattr(forward_module, "spread", left_running)
    monkeypatch.setattr(Tensor, "new_empty", new_empty)
    builder = Builder(fn, (1, 1, 1), "", None)
    given = torch.ones(1, 1), torch.ones(1, 3, 1), torch.ones(1, 1)
    with pytest.raises(KeyboardInterrupt):
        forward_module.run_forward(builder, *given, Schedule(0.1, 1, 1, 2))
    gc.collect()
    assert [array() is not None for array in frames] == [True]
    kept.clear()
    gc.collect()
    assert [array() is not None for array in frames] == [False]
