"""Kernel calls side by side, in threads that stay."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache


def spread(run: Callable[[int], None], tasks: Iterable[int], threads: int) -> None:
    """Run all tasks, in so many threads: kernels let go of Python's lock. Raises what a task raises."""
    waiting = list(tasks)
    helpers = min(threads, len(waiting)) - 1
    left = iter(waiting)  # one for all: whoever is free takes the next

    def work() -> None:
        for task in left:
            run(task)

    if helpers < 1:
        work()
        return
    pool = _pool(threads - 1, os.getpid())
    helped = [pool.submit(work) for _ in range(helpers)]
    try:
        work()
    finally:
        # After an error or Ctrl-C nobody wants the rest: helpers end with what they have in hand.
        deque(left, maxlen=0)
        wait(helped)
    for one in helped:
        one.result()


@cache
def _pool(threads: int, process: int) -> ThreadPoolExecutor:
    """Threads that stay: a rollout of a few steps takes less time than to start them. process: a forked one has none of
    its parent's threads."""
    return ThreadPoolExecutor(threads, thread_name_prefix=f"kernels-{process}")
