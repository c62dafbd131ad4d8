"""From a step function to kernels that can be called: traced, differentiated, emitted, compiled; or read from disk."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import RLock
from time import perf_counter
from typing import Any

import torch

from r2s2r_cli.engine.native import cache, machine
from r2s2r_cli.engine.native.kernels import module_text
from r2s2r_cli.engine.native.llvm_text import Target
from r2s2r_cli.engine.native.packs import Twins
from r2s2r_cli.engine.native.program import (
    Active,
    Backward,
    Forward,
    Tangent,
    backward_program,
    forward_program,
    tangent_program,
)
from r2s2r_cli.engine.native.symbolic import StepFn

REAL = {torch.float64: "double", torch.float32: "float"}
"""LLVM's name of the types that kernels compute in."""


@dataclass(frozen=True)
class Kernel:
    """One kernel: what it is for ("forward", "backward" or "tangent"), and in which form. lanes: 1 or a power of two.
    active: for a tangent kernel, which inputs may carry a tangent."""

    kind: str
    dtype: torch.dtype
    lanes: int
    active: Active | None = None


@dataclass(frozen=True)
class Build:
    """What it took to make a kernel ready [s]. operations: nodes of its program. trace_s counts the step's own tracing
    where this kernel was the first of its dtype, and the differentiation."""

    kind: str
    dtype: str
    lanes: int
    operations: int
    trace_s: float
    emit_s: float
    compile_s: float
    load_s: float
    from_cache: bool


class Builder:
    """Makes the kernels of one step function, each when it is first asked for, and keeps them."""

    def __init__(
        self, fn: StepFn, sizes: tuple[int, int, int], key: str, cache_dir: Path | None, twins: Twins = ()
    ) -> None:
        self.log: list[Build] = []
        self._fn, self._sizes, self._key, self._cache_dir = fn, sizes, key, cache_dir
        self._twins = twins
        self._ready: dict[Kernel, Callable[..., None]] = {}
        self._programs: dict[torch.dtype, Forward] = {}
        self._lock = RLock()

    def kernel(self, kernel: Kernel) -> Callable[..., None]:
        """The kernel's function, made ready. Raises TracingError."""
        with self._lock:
            if kernel not in self._ready:
                self._ready[kernel] = self._make(kernel)
            return self._ready[kernel]

    def program(self, dtype: torch.dtype) -> Forward:
        """The traced step. Raises TracingError."""
        if dtype not in self._programs:
            # In inference mode torch decomposes nothing, and what it does not decompose cannot be traced.
            inference = torch.is_inference_mode_enabled()
            with torch.inference_mode(False) if inference else nullcontext():
                self._programs[dtype] = forward_program(self._fn, *self._sizes, dtype)
        return self._programs[dtype]

    def _make(self, kernel: Kernel) -> Callable[..., None]:
        n_arrays = {"forward": 5, "backward": 8, "tangent": 9}[kernel.kind]
        path = self._path(kernel)
        stored = cache.read(path) if path else None
        times = {"trace_s": 0.0, "emit_s": 0.0, "compile_s": 0.0}
        if stored is None:
            text, operations = self._text(kernel, times)
            start = perf_counter()
            code = machine.compiled(text)
            times["compile_s"] = perf_counter() - start
            if path:
                cache.write(path, {"operations": operations}, code)
        else:
            about, code = stored
            operations = about["operations"]
        start = perf_counter()
        function = machine.loaded(code, n_arrays)
        self.log.append(
            Build(
                kernel.kind,
                REAL[kernel.dtype],
                kernel.lanes,
                operations,
                **times,
                load_s=perf_counter() - start,
                from_cache=stored is not None,
            )
        )
        return function

    def _path(self, kernel: Kernel) -> Path | None:
        if self._cache_dir is None:
            return None
        active = None if kernel.active is None else asdict(kernel.active)
        parts: list[Any] = [self._key, self._sizes, kernel.kind, REAL[kernel.dtype], kernel.lanes, active, self._twins]
        return self._cache_dir / cache.file_name(*parts)

    def _text(self, kernel: Kernel, times: dict[str, float]) -> tuple[str, int]:
        start = perf_counter()
        forward = self.program(kernel.dtype)
        target = Target(REAL[kernel.dtype], kernel.lanes, dual=kernel.kind == "tangent")
        program: Forward | Backward | Tangent = forward
        if kernel.kind == "backward":
            program = backward_program(forward)
        elif kernel.active is not None:
            program = tangent_program(forward, kernel.active)
        times["trace_s"] = perf_counter() - start
        start = perf_counter()
        text = module_text(program, target, self._twins)
        times["emit_s"] = perf_counter() - start
        return text, program.operations()
