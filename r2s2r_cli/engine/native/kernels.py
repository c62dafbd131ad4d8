"""The three kernels: a loop over the steps of a rollout, whose body is the program of one step or of its derivative.

All arrays hold numbers, or vectors in a kernel of lanes; a vector's lanes are environments, but for the kernel of
tangents, whose states are numbers and whose tangents are vectors of directions. Steps count from `begin` to `end`;
step t reads row t // hold of the inputs, and the state after it is frame (t + 1) // every if that divides.
"""

from __future__ import annotations

from collections.abc import Sequence

from r2s2r_cli.engine.native.emit import Body, Place, subroutine_text
from r2s2r_cli.engine.native.graph import Graph
from r2s2r_cli.engine.native.hoist import Hoisted, hoisted
from r2s2r_cli.engine.native.llvm_text import Module, Target
from r2s2r_cli.engine.native.pack_order import units
from r2s2r_cli.engine.native.packed import PackedBody
from r2s2r_cli.engine.native.packs import Packs, Twins
from r2s2r_cli.engine.native.passes import depths, live
from r2s2r_cli.engine.native.program import Backward, Forward, Tangent

STEPS = "i64 %begin, i64 %end, i64 %hold, i64 %every"


class _Kernel:
    """What the kernels share: the entry block with hoisted values, and the loop's body.

    twins: inputs of equal parts. A kernel of single numbers computes equal parts side by side (`packs`).
    """

    def __init__(
        self, target: Target, g: Graph, inside: Sequence[int], after: Sequence[int], arrays: str, twins: Twins = ()
    ) -> None:
        self._twins, self._outputs = twins if target.lanes == 1 else (), list(inside)
        self.module, self.g = Module(target), g
        self.head = f"define void @kernel({', '.join(f'ptr %{name}' for name in arrays.split())}, {STEPS}) nounwind {{"
        self.entry = Body(self.module, g, self._place({"p": "%P", "h": "%H", "dp": "%DP"}), "e")
        self.split: Hoisted = hoisted(g, inside)
        self._used = sorted({g.args[i][0] for i in live(g, [*inside, *after]) if g.ops[i] == "call"})
        self._allocate()

    def _place(self, arrays: dict[str, str]) -> Place:
        """Where inputs are: in the array of their kind, at their index."""

        def place(kind: str, index: int) -> str:
            body = self._at
            wide = self.module.target.lanes > 1 and (not self.module.target.dual or kind.startswith("d"))
            return body.element(arrays[kind], index, vector=wide)

        return place

    def _allocate(self) -> None:
        entry, target, g = self.entry, self.module.target, self.g
        self._at = entry
        vector = target.type(vector=True)
        if self._used:
            subs = [g.subroutines[number] for number in self._used]
            room = max(sub.n_inputs * (1 + sub.dual) for sub in subs), max(len(sub.outputs) for sub in subs)
            for name, n in zip(("arguments", "results"), room, strict=True):
                entry.do(f"%{name} = alloca {vector}, i64 {max(n, 1)}, align 64")
        kept = {wide: [i for i in self.split.kept if entry.vector(i) == wide] for wide in (False, True)}
        for wide, nodes in kept.items():
            if nodes:
                entry.do(f"%kept{wide:d} = alloca {target.type(vector=wide)}, i64 {len(nodes)}, align 64")
        entry.run(self.split.before)
        self.kept: dict[int, str] = {}
        for wide, nodes in kept.items():
            for k, i in enumerate(nodes):
                self.kept[i] = entry.element(f"%kept{wide:d}", k, vector=wide)
                entry.store(entry.value(i), self.kept[i], vector=wide)

    def body(self, arrays: dict[str, str]) -> Body:
        """The loop's body, with the hoisted values at hand."""
        place = self._place({"p": "%P", "h": "%H", "dp": "%DP", **arrays})
        packs = Packs(self.g, live(self.g, self._outputs), self._twins)
        body = (
            PackedBody(self.module, self.g, place, packs, self.entry)
            if packs
            else Body(self.module, self.g, place, "l")
        )
        self._at = body
        body.stored = dict(self.kept)
        body.block = "loop"
        return body

    def run(self, body: Body) -> None:
        """Emit the loop's nodes."""
        if isinstance(body, PackedBody):
            body.run_units(units(body.packs, self.split.inside, depths(self.g, live(self.g, self._outputs))))
        else:
            body.run(self.split.inside)

    def after(self, arrays: dict[str, str]) -> Body:
        """What follows the loop; values of the entry block hold there."""
        self._at = Body(self.module, self.g, self._place({"p": "%P", "h": "%H", "dp": "%DP", **arrays}), "a")
        self._at.values = dict(self.entry.values)
        self._at.block = "finish"
        return self._at

    def text(self, *blocks: str) -> str:
        """The module, with the subroutines that it calls."""
        for number in self._used:
            subroutine_text(self.module, self.g.subroutines[number], number)
        self.module.functions.append("\n".join([self.head, "entry:", *self.entry.lines, *blocks, "}"]))
        return self.module.text()


def module_text(program: Forward | Backward | Tangent, target: Target, twins: Twins = ()) -> str:
    """Text of the module with the program's kernel; twins: see `packs`."""
    if isinstance(program, Backward):
        return backward_text(program, target, twins)
    return forward_text(program, target, twins) if isinstance(program, Forward) else tangent_text(program, target)


def forward_text(program: Forward, target: Target, twins: Twins = ()) -> str:
    """Module of the forward kernel: (S, F, U, P, H, steps). S: the state, replaced; F: frames."""
    kernel = _Kernel(target, program.graph, program.state, (), "S F U P H", twins)
    body = kernel.body({"s": "%S", "u": "%u"})
    kernel.run(body)
    _store_all(body, program.state, "%S")
    return kernel.text(
        _loop_head(body, {"u": ("%U", program.n_input)}), *body.lines, _frames(target, [("F", "S", len(program.state))])
    )


def tangent_text(program: Tangent, target: Target) -> str:
    """Module of the tangent kernel: (S, DS, F, DF, U, DU, P, DP, H, steps)."""
    kernel = _Kernel(target, program.graph, (*program.state, *program.tangents), (), "S DS F DF U DU P DP H")
    body = kernel.body({"s": "%S", "ds": "%DS", "u": "%u", "du": "%du"})
    body.run(kernel.split.inside)
    _store_all(body, program.state, "%S")
    _store_all(body, program.tangents, "%DS", wide=True)
    rows = {"u": ("%U", program.n_input), "du": ("%DU", program.n_input)}
    n = len(program.state)
    return kernel.text(_loop_head(body, rows), *body.lines, _frames(target, [("F", "S", n), ("DF", "DS", n)]))


def backward_text(program: Backward, target: Target, twins: Twins = ()) -> str:
    """Module of the backward kernel: (S, U, P, H, A, GF, GU, GP, steps).

    S: states from `begin` on. A: adjoint of the last state, replaced by that of the first. GF: adjoints of frames. GU,
    GP: adjoints of inputs and parameters, added to. Adjoints of hoisted values gather in the loop and are taken back to
    the parameters once, after it.
    """
    inside, n = [*program.state, *program.inputs, *program.kept], len(program.state)
    kernel = _Kernel(target, program.graph, inside, program.parameters, "S U P H A GF GU GP", twins)
    vector = target.type(vector=True)
    entry = kernel.entry
    entry.do(f"%Q = alloca {vector}, i64 {max(len(program.kept), 1)}, align 64")
    zero = target.literal(0.0, vector=True)
    for k in range(len(program.kept)):
        entry.store(zero, entry.element("%Q", k, vector=True), vector=True)

    body = kernel.body({"s": "%s", "u": "%u", "a": "%A"})
    kernel.run(body)
    _store_all(body, program.state, "%A")
    _add_all(body, program.inputs, "%gu")
    _add_all(body, program.kept, "%Q")
    after = kernel.after({"q": "%Q"})
    _add_all(after, program.parameters, "%GP")

    seed = Body(kernel.module, program.graph, lambda kind, index: "", "f")
    for k in range(n):
        pointer = seed.element("%A", k, vector=True)
        total = seed.put(
            f"fadd {vector} {seed.load(pointer, vector=True)}, "
            f"{seed.load(seed.element('%f', k, vector=True), vector=True)}"
        )
        seed.store(total, pointer, vector=True)
    return kernel.text(
        "br label %loop\nloop:",
        "%t1 = phi i64 [ %end, %entry ], [ %t, %next ]\n%t = sub i64 %t1, 1",
        "%rest = urem i64 %t1, %every\n%framed = icmp eq i64 %rest, 0\nbr i1 %framed, label %frame, label %step",
        f"frame:\n%number = udiv i64 %t1, %every\n%f0 = mul i64 %number, {n}",
        f"%f = getelementptr {vector}, ptr %GF, i64 %f0",
        *seed.lines,
        "br label %step\nstep:",
        f"%s0 = sub i64 %t, %begin\n%s1 = mul i64 %s0, {n}\n%s = getelementptr {vector}, ptr %S, i64 %s1",
        f"%row = udiv i64 %t, %hold\n%u0 = mul i64 %row, {program.n_input}",
        f"%u = getelementptr {vector}, ptr %U, i64 %u0\n%gu = getelementptr {vector}, ptr %GU, i64 %u0",
        *_renamed(body.lines, "loop", "step"),
        "br label %next\nnext:\n%done = icmp ule i64 %t, %begin\nbr i1 %done, label %finish, label %loop\nfinish:",
        *after.lines,
        "ret void",
    )


def _renamed(lines: list[str], old: str, new: str) -> list[str]:
    """The lines, phis coming from block `new` instead of `old`."""
    return [line.replace(f"%{old} ]", f"%{new} ]") for line in lines]


def _loop_head(body: Body, rows: dict[str, tuple[str, int]]) -> str:
    lines = ["br label %loop", "loop:", "%t = phi i64 [ %begin, %entry ], [ %t1, %next ]", "%row = udiv i64 %t, %hold"]
    for name, (array, n) in rows.items():
        wide = body.target.type(vector=not body.target.dual or name == "du")
        lines.append(f"%{name}0 = mul i64 %row, {n}\n%{name} = getelementptr {wide}, ptr {array}, i64 %{name}0")
    return "\n".join(lines)


def _store_all(body: Body, nodes: Sequence[int], array: str, *, wide: bool | None = None) -> None:
    """Store after all are computed: the array is also what the body reads."""
    wide = (body.target.lanes > 1 and not body.target.dual) if wide is None else wide
    values = [body.value(i, vector=wide) for i in nodes]
    for k, value in enumerate(values):
        body.store(value, body.element(array, k, vector=wide), vector=wide)


def _add_all(body: Body, nodes: Sequence[int], array: str) -> None:
    kind = body.target.type(vector=True)
    for k, i in enumerate(nodes):
        if body.g.value(i) == 0:
            continue
        pointer = body.element(array, k, vector=True)
        total = body.put(f"fadd {kind} {body.load(pointer, vector=True)}, {body.value(i, vector=True)}")
        body.store(total, pointer, vector=True)


def _frames(target: Target, copies: list[tuple[str, str, int]]) -> str:
    """End of the loop: copy the state to its frame when due."""
    lines = ["%t1 = add i64 %t, 1\n%rest = urem i64 %t1, %every\n%framed = icmp eq i64 %rest, 0"]
    lines += ["br i1 %framed, label %frame, label %next\nframe:\n%number = udiv i64 %t1, %every"]
    for to, source, n in copies:
        wide = source == "DS" or not target.dual
        size = n * target.size * (target.lanes if wide else 1)
        lines.append(f"%{to}0 = mul i64 %number, {size}\n%{to}1 = getelementptr i8, ptr %{to}, i64 %{to}0")
        lines.append(f"call void @llvm.memcpy.p0.p0.i64(ptr %{to}1, ptr %{source}, i64 {size}, i1 false)")
    lines.append(
        "br label %next\nnext:\n%done = icmp uge i64 %t1, %end\nbr i1 %done, label %finish, label %loop\nfinish:"
    )
    return "\n".join([*lines, "ret void"])
