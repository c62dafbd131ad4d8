"""LLVM text: types, constants and declarations of one module, and the lane-by-lane calls of the C library."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field

import numpy as np

LIBRARY = (
    "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "expm1", "log", "log1p", "atan2", "pow",
)  # fmt: skip
"""Functions of the C library, called lane by lane."""


@dataclass(frozen=True)
class Target:
    """How numbers are held. real: "double" or "float". lanes: of vectors. dual: whether only tangents are vectors."""

    real: str
    lanes: int
    dual: bool = False

    @property
    def size(self) -> int:
        """Bytes of one number."""
        return 8 if self.real == "double" else 4

    def type(self, *, vector: bool, boolean: bool = False) -> str:
        """LLVM type of a value."""
        element = "i1" if boolean else self.real
        return f"<{self.lanes} x {element}>" if vector and self.lanes > 1 else element

    def suffix(self, *, vector: bool) -> str:
        """Type in the name of an intrinsic."""
        name = "f64" if self.real == "double" else "f32"
        return f"v{self.lanes}{name}" if vector and self.lanes > 1 else name

    def align(self, *, vector: bool) -> int:
        """Alignment of a value in memory, bytes; torch aligns its arrays to 64."""
        return min(64, self.size * (self.lanes if vector else 1))

    def literal(self, value: float, *, vector: bool) -> str:
        """A constant. Hexadecimal: LLVM reads decimal fractions only where they are exact."""
        if self.real == "float":
            with np.errstate(over="ignore"):
                value = float(np.float32(value))
        text = f"0x{struct.pack('>d', value).hex().upper()}"
        return f"splat ({self.real} {text})" if vector and self.lanes > 1 else text


@dataclass
class Module:
    """Text of one LLVM module in the making: functions, and declarations and helpers that they need."""

    target: Target
    functions: list[str] = field(default_factory=list)
    declared: dict[str, str] = field(default_factory=dict)

    def text(self) -> str:
        """The module."""
        return "\n".join([*self.declared.values(), *self.functions]) + "\n"

    def intrinsic(self, name: str, n: int, *, vector: bool) -> str:
        """Name of an LLVM intrinsic of n arguments, declared."""
        full, kind = f"@llvm.{name}.{self.target.suffix(vector=vector)}", self.target.type(vector=vector)
        self.declared.setdefault(full, f"declare {kind} {full}({', '.join([kind] * n)})")
        return full

    def packed_intrinsic(self, name: str, n: int, width: int) -> str:
        """Name of an LLVM intrinsic on packs of so many numbers, declared."""
        suffix = f"v{width}f{8 * self.target.size}"
        full, kind = f"@llvm.{name}.{suffix}", f"<{width} x {self.target.real}>"
        self.declared.setdefault(full, f"declare {kind} {full}({', '.join([kind] * n)})")
        return full

    def any(self) -> str:
        """Name of the intrinsic that tells whether any lane of a truth value holds, declared."""
        name = f"@llvm.vector.reduce.or.v{self.target.lanes}i1"
        self.declared.setdefault(name, f"declare i1 {name}(<{self.target.lanes} x i1>)")
        return name

    def library(self, name: str, n: int, *, vector: bool) -> str:
        """Name of a function of the C library; for vectors of a helper that calls it lane by lane."""
        real, kind = self.target.real, self.target.type(vector=vector)
        plain = f"@{name}" + ("" if real == "double" else "f")
        self.declared.setdefault(plain, f"declare {real} {plain}({', '.join([real] * n)}) nounwind memory(none)")
        if kind == real:
            return plain
        lanes = f"@lanes.{name}"
        if lanes not in self.declared:
            arguments = ", ".join(f"{kind} %a{k}" for k in range(n))
            lines = [f"define internal {kind} {lanes}({arguments}) noinline nounwind {{"]
            result = "poison"
            for lane in range(self.target.lanes):
                for k in range(n):
                    lines.append(f"%x{lane}.{k} = extractelement {kind} %a{k}, i32 {lane}")
                inner = ", ".join(f"{real} %x{lane}.{k}" for k in range(n))
                lines.append(f"%y{lane} = call {real} {plain}({inner})")
                lines.append(f"%r{lane} = insertelement {kind} {result}, {real} %y{lane}, i32 {lane}")
                result = f"%r{lane}"
            self.declared[lanes] = "\n".join([*lines, f"ret {kind} {result}", "}"])
        return lanes
