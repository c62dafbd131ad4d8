"""LLVM text of scalar programs: one instruction a node, on single numbers or on lanes.

In a program of one environment every value is a number; in lanes every value is a vector, one lane an environment; in a
dual program values are numbers and tangents are vectors, one lane a direction. No flag allows LLVM to change a result:
what may be fused was fused in `passes`, and the same program gives the same bits in every width.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from r2s2r_cli.engine.native.graph import Graph, Subroutine
from r2s2r_cli.engine.native.llvm_text import Module
from r2s2r_cli.engine.native.passes import depth_order, live

INTRINSIC = {
    "sqrt": "sqrt", "abs": "fabs", "floor": "floor", "ceil": "ceil", "trunc": "trunc", "round": "roundeven",
    "min": "minimum", "max": "maximum", "fma": "fmuladd",
}  # fmt: skip
PLAIN = {"add": "fadd", "sub": "fsub", "mul": "fmul", "div": "fdiv", "and": "and"}
COMPARE = {"lt": "olt", "le": "ole", "eq": "oeq"}


Place = Callable[[str, int], str]
"""Where an input is in memory: (kind, index) -> text of a pointer value, emitted beforehand."""


class Body:
    """Instructions of one function, and which value each node of its program has so far."""

    def __init__(self, module: Module, g: Graph, place: Place, prefix: str = "") -> None:
        self.module, self.g, self.place = module, g, place
        self.target = module.target
        self.lines: list[str] = []
        self.block = "entry"
        self.values: dict[int, str] = {}
        self.stored: dict[int, str] = {}
        self._splats: dict[int, str] = {}
        self._vector: dict[int, bool] = {}
        self._count = 0
        self._prefix = prefix

    def name(self) -> str:
        """A new name of a value or label, without %."""
        self._count += 1
        return f"{self._prefix}v{self._count}"

    def put(self, text: str) -> str:
        """Emit an instruction that has a value; its name."""
        name = f"%{self.name()}"
        self.lines.append(f"{name} = {text}")
        return name

    def do(self, text: str) -> None:
        """Emit an instruction without value."""
        self.lines.append(text)

    def label(self, name: str) -> None:
        """Begin a block."""
        self.lines.append(f"{name}:")
        self.block = name

    def vector(self, i: int) -> bool:
        """Whether node i is a vector: always in lanes, tangents only in a dual program."""
        if self.target.lanes == 1 or not self.target.dual:
            return self.target.lanes > 1
        known = self._vector.get(i)
        if known is None:
            g = self.g
            if g.ops[i] == "in":
                known = g.args[i][0].startswith("d")
            elif g.ops[i] == "get":
                call = g.args[g.args[i][0]]
                known = self._widths(g.subroutines[call[0]], len(call[3]))[g.args[i][1]]
            elif g.ops[i] == "call":
                known = False
            else:
                known = any(self.vector(k) for k in g.arguments(i))
            self._vector[i] = known
        return known

    def type(self, i: int) -> str:
        """LLVM type of node i."""
        return self.target.type(vector=self.vector(i), boolean=self.g.boolean(i))

    def element(self, pointer: str, index: int | str, *, vector: bool) -> str:
        """Pointer to an element of an array of numbers or vectors."""
        return self.put(f"getelementptr {self.target.type(vector=vector)}, ptr {pointer}, i64 {index}")

    def load(self, pointer: str, *, vector: bool) -> str:
        """Load a number or a vector."""
        return self.put(
            f"load {self.target.type(vector=vector)}, ptr {pointer}, align {self.target.align(vector=vector)}"
        )

    def store(self, value: str, pointer: str, *, vector: bool) -> None:
        """Store a number or a vector."""
        kind, align = self.target.type(vector=vector), self.target.align(vector=vector)
        self.do(f"store {kind} {value}, ptr {pointer}, align {align}")

    def splat(self, number: str) -> str:
        """A vector of one number."""
        kind = self.target.type(vector=True)
        one = self.put(f"insertelement {kind} poison, {self.target.real} {number}, i32 0")
        return self.put(f"shufflevector {kind} {one}, {kind} poison, <{self.target.lanes} x i32> zeroinitializer")

    def value(self, i: int, *, vector: bool | None = None) -> str:
        """The value of node i, as a vector if asked; loads inputs and what the entry block kept."""
        vector = self.vector(i) if vector is None else vector and self.target.lanes > 1
        if self.g.ops[i] == "const":
            return self.target.literal(self.g.args[i][0], vector=vector)
        if vector and not self.vector(i) and not self.g.boolean(i):
            if i not in self._splats:
                self._splats[i] = self.splat(self.value(i))
            return self._splats[i]
        if i not in self.values:
            if i in self.stored:
                self.values[i] = self.load(self.stored[i], vector=self.vector(i))
            elif self.g.ops[i] == "in":
                self.values[i] = self.load(self.place(*self.g.args[i]), vector=self.vector(i))
            else:
                self.emit(i)
        return self.values[i]

    def run(self, nodes: Iterable[int]) -> None:
        """Emit nodes in this order."""
        for i in nodes:
            if self.g.ops[i] not in ("const", "in") and i not in self.values and i not in self.stored:
                self.emit(i)

    def emit(self, i: int) -> None:
        """Emit the operation of node i."""
        op, args = self.g.ops[i], self.g.args[i]
        if op == "call":
            self._call(i)
            return
        if op == "get":
            self.value(args[0])
            return
        if op == "true":
            kind = self.type(i)
            self.values[i] = (
                ("splat (i1 true)" if args[0] else "zeroinitializer") if "<" in kind else str(args[0]).lower()
            )
            return
        vector = self.vector(i)
        if op == "det":
            self.values[i] = self.value(args[0])
        elif op == "select":
            condition, kind = self.value(args[0]), self.target.type(vector=vector)
            a, b = self.value(args[1], vector=vector), self.value(args[2], vector=vector)
            self.values[i] = self.put(f"select {self.type(args[0])} {condition}, {kind} {a}, {kind} {b}")
        elif op == "not":
            ones = "splat (i1 true)" if "<" in self.type(i) else "true"
            self.values[i] = self.put(f"xor {self.type(i)} {self.value(args[0])}, {ones}")
        else:
            kind = self.type(i) if op == "and" else self.target.type(vector=vector)
            values = [self.value(k, vector=vector) for k in args]
            if op in COMPARE:
                self.values[i] = self.put(f"fcmp {COMPARE[op]} {kind} {values[0]}, {values[1]}")
            elif op in PLAIN:
                self.values[i] = self.put(f"{PLAIN[op]} {kind} {values[0]}, {values[1]}")
            elif op == "neg":
                self.values[i] = self.put(f"fneg {kind} {values[0]}")
            else:
                find = self.module.intrinsic if op in INTRINSIC else self.module.library
                function = find(INTRINSIC.get(op, op), len(args), vector=vector)
                given = ", ".join(f"{kind} {value}" for value in values)
                self.values[i] = self.put(f"call {kind} {function}({given})")

    def _call(self, i: int) -> None:
        """A branch round the call of a subroutine, which reads and writes arrays on the stack."""
        number, flag, inputs, otherwise = self.g.args[i]
        sub = self.g.subroutines[number]
        wide_in, wide_out = self._widths(sub, len(inputs)), self._widths(sub, len(otherwise))
        # What the entry block kept in memory is loaded inside the branch, since it is rarely taken.
        waiting = [None if k in self.values else self.stored.get(k) for k in inputs]
        given = [w or self.value(k, vector=wide) for k, w, wide in zip(inputs, waiting, wide_in, strict=True)]
        rest = [self.value(k, vector=wide) for k, wide in zip(otherwise, wide_out, strict=True)]
        condition, truth = self.value(flag), self.type(flag)
        some = condition
        if truth != "i1":
            some = self.put(f"call i1 {self.module.any()}({truth} {condition})")
        inside, after, before = self.name(), self.name(), self.block
        self.do(f"br i1 {some}, label %{inside}, label %{after}")
        self.label(inside)
        for k, (value, w, wide) in enumerate(zip(given, waiting, wide_in, strict=True)):
            value = self.load(value, vector=self.vector(inputs[k])) if w else value
            self.store(value, self.element("%arguments", k, vector=True), vector=wide)
        self.do(f"call void @subroutine{number}(ptr %arguments, ptr %results)")
        results = []
        for k, (other, wide) in enumerate(zip(rest, wide_out, strict=True)):
            result = self.load(self.element("%results", k, vector=True), vector=wide)
            if truth != "i1":
                kind = self.target.type(vector=wide)
                result = self.put(f"select {truth} {condition}, {kind} {result}, {kind} {other}")
            results.append(result)
        self.do(f"br label %{after}")
        self.label(after)
        for k, (result, other, wide) in enumerate(zip(results, rest, wide_out, strict=True)):
            kind = self.target.type(vector=wide)
            phi = self.put(f"phi {kind} [ {other}, %{before} ], [ {result}, %{inside} ]")
            self.values[self.g.node("get", i, k)] = phi
        self.values[i] = "called"

    def _widths(self, sub: Subroutine, n: int) -> list[bool]:
        """Whether each of n arguments (or results) of a subroutine is a vector: tangents are the second half."""
        if self.target.dual:
            return [sub.dual and 2 * k >= n for k in range(n)]
        return [self.target.lanes > 1] * n


def subroutine_text(module: Module, sub: Subroutine, number: int) -> None:
    """Add a subroutine to the module: (arguments, results), arrays with room for a vector in every place."""

    def place(kind: str, index: int) -> str:
        return body.element("%arguments", index + (sub.n_inputs if kind == "dx" else 0), vector=True)

    body = Body(module, sub.graph, place)
    body.run(depth_order(sub.graph, live(sub.graph, sub.outputs)))
    for k, i in enumerate(sub.outputs):
        wide = body.vector(i) if not sub.dual else 2 * k >= len(sub.outputs)
        body.store(body.value(i, vector=wide), body.element("%results", k, vector=True), vector=wide)
    head = f"define internal void @subroutine{number}(ptr noalias %arguments, ptr noalias %results) nounwind {{"
    module.functions.append("\n".join([head, *body.lines, "ret void", "}"]))
