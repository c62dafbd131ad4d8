"""LLVM through llvmlite: from a module's text to object code, and from object code to a function to call."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from r2s2r_cli.engine.native.llvm_text import LIBRARY

OPTIONS = ("-post-RA-scheduler=false", "-greedy-reverse-local-assignment")
"""Options of the code generator that take a third off compiling these long blocks, at no loss of speed."""


@lru_cache(maxsize=1)
def binding() -> Any:
    """llvmlite.binding, ready for this machine. Raises ImportError where llvmlite is not installed."""
    import llvmlite.binding as llvm

    for option in OPTIONS:
        llvm.set_option("r2s2r", option)

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    library = ctypes.CDLL(None) if _has_process_symbols() else ctypes.CDLL("ucrtbase")
    for name in LIBRARY:
        for suffix in ("", "f"):
            function = getattr(library, name + suffix, None)
            if function is not None:
                llvm.add_symbol(name + suffix, ctypes.cast(function, ctypes.c_void_p).value)
    return llvm


def _has_process_symbols() -> bool:
    return not hasattr(ctypes, "windll")


def available() -> bool:
    """Whether kernels can be compiled here."""
    try:
        binding()
    except (ImportError, OSError):
        return False
    return True


@lru_cache(maxsize=1)
def host() -> tuple[str, str]:
    """Name and features of this processor, in LLVM's words."""
    llvm = binding()
    return llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


def vector_bytes() -> int:
    """Width of this processor's vectors."""
    features = host()[1].split(",")
    return 64 if "+avx512f" in features else 32 if "+avx2" in features else 16


def _machine() -> Any:
    """A new target machine: an execution engine takes the one that it is given, and frees it."""
    llvm = binding()
    name, features = host()
    return llvm.Target.from_default_triple().create_target_machine(cpu=name, features=features, opt=2, jit=True)


def compiled(text: str) -> bytes:
    """Object code of a module. The text is already in good form: no pass of LLVM's optimiser runs, only its code
    generator."""
    llvm = binding()
    machine = _machine()
    module = llvm.parse_assembly(text)
    module.triple = machine.triple
    module.data_layout = str(machine.target_data)
    return bytes(machine.emit_object(module))


def loaded(code: bytes, n_arrays: int) -> Callable[..., None]:
    """The function `kernel` of object code: n_arrays addresses, then four integers. It keeps its code alive."""
    llvm = binding()
    empty = llvm.parse_assembly("")
    target = _machine()
    empty.triple = target.triple
    engine = llvm.create_mcjit_compiler(empty, target)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    kind = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * n_arrays, *[ctypes.c_int64] * 4)
    function = kind(engine.get_function_address("kernel"))
    function.engine = engine  # type: ignore[attr-defined]
    return function
