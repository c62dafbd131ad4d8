"""Fixtures that every test folder shares."""

from __future__ import annotations

import gc
import os
import signal
import sys
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

from r2s2r_cli.store.project import SHARED_CACHE

# One worker a core: threads of a linear algebra would only wait for each other. Before anything imports numpy or torch.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# A loaded machine is slow, which is no fault of the code under test: no test here asserts a time.
settings.register_profile("loaded", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("loaded")

# A suite that a shell starts with `&` is deaf to the two keys, and so are all processes that it starts: tests of them
# would fail. In a worker of pytest-xdist tests run in the main thread too.
for _number, _usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGQUIT, signal.SIG_DFL)):
    if signal.getsignal(_number) is signal.SIG_IGN:
        signal.signal(_number, _usual)

REAL = Path(__file__).resolve().parents[2] / "shared" / "real"


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Collect tests without collecting garbage: it would look a dozen times at millions of objects that all stay, which
    is a third of the time. Nor are they looked at later on, and what tests leave behind is seldom."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(10_000, 20, 100)
        gc.enable()


@pytest.fixture(scope="session")
def real_dir() -> Path:
    """Folder of real measurements; skips where it is absent (it may not be copied into the project)."""
    if not REAL.is_dir():
        pytest.skip("the real measurements (../shared/real) are not on this machine")
    return REAL


@pytest.fixture(scope="session", autouse=True)
def kernels(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """All projects of this session, and simulators that keep their machine code nowhere, find and leave it in one
    folder, for all workers and for the commands that tests start: the same kernel is compiled once, not in every
    project. CI names one for all its steps."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "kernels"
    folder = Path(os.environ.get(SHARED_CACHE) or folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(SHARED_CACHE, str(folder))
        rollout = sys.modules.get("r2s2r_cli.engine.rollout")  # where no test needs the engine, torch is not loaded
        if rollout is not None:
            init = rollout.Simulator.__init__

            def shared(self: Any, structure: Any, *, cache_dir: Path | None = None, **how: Any) -> None:
                init(self, structure, cache_dir=cache_dir or folder, **how)

            patch.setattr(rollout.Simulator, "__init__", shared)
        yield
