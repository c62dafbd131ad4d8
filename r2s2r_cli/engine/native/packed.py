"""LLVM text of a program of single numbers whose packs are vector instructions."""

from __future__ import annotations

from collections.abc import Iterable

from r2s2r_cli.engine.native.emit import COMPARE, INTRINSIC, PLAIN, Body, Place
from r2s2r_cli.engine.native.graph import Graph
from r2s2r_cli.engine.native.llvm_text import Module
from r2s2r_cli.engine.native.packs import WIDTH, Packs

_LANES = range(WIDTH)


class PackedBody(Body):
    """A body that knows packs. A pack of fewer than four values repeats its first, so that no lane holds anything odd.

    entry: the body before the loop, where vectors of values that stay the same are put together once.
    """

    def __init__(self, module: Module, g: Graph, place: Place, packs: Packs, entry: Body) -> None:
        super().__init__(module, g, place, "l")
        self.packs, self.entry = packs, entry
        self.vectors: dict[tuple[int, ...], str] = {}
        self.kept_vectors: dict[tuple[int, ...], str] = {}

    @property
    def wide(self) -> str:
        """LLVM type of a pack of numbers."""
        return f"<{WIDTH} x {self.target.real}>"

    def kind(self, i: int) -> str:
        """LLVM type of the pack of node i."""
        return f"<{WIDTH} x i1>" if self.g.boolean(i) else self.wide

    def run_units(self, order: Iterable[tuple[int, ...]]) -> None:
        """Emit packs and single nodes in this order."""
        for unit in order:
            if len(unit) > 1:
                self._pack(unit)
            else:
                self.run(unit)

    def value(self, i: int, *, vector: bool | None = None) -> str:
        """The value of node i alone, taken out of its pack if it is in one."""
        place = self.packs.place.get(i)
        if i not in self.values and place is not None and place[0] in self.packs.operands:
            members = self.packs.members[place[0]]
            vector_name = self.vectors.get(members) or self._pack(members)
            self.values[i] = self.put(f"extractelement {self.kind(i)} {vector_name}, i32 {place[1]}")
        return super().value(i, vector=vector)

    def _pack(self, members: tuple[int, ...]) -> str:
        if members in self.vectors:
            return self.vectors[members]
        g, first = self.g, members[0]
        op, number = g.ops[first], self.packs.place[first][0]
        given = [self._operand(column) for column in self.packs.operands[number]]
        kinds = [self.kind(column[0]) for column in self.packs.operands[number]]
        if op == "det":
            name = given[0]
        elif op == "select":
            name = self.put(f"select {kinds[0]} {given[0]}, {kinds[1]} {given[1]}, {kinds[2]} {given[2]}")
        elif op == "not":
            name = self.put(f"xor {kinds[0]} {given[0]}, splat (i1 true)")
        elif op in COMPARE:
            name = self.put(f"fcmp {COMPARE[op]} {kinds[0]} {given[0]}, {given[1]}")
        elif op in PLAIN:
            name = self.put(f"{PLAIN[op]} {kinds[0]} {given[0]}, {given[1]}")
        elif op == "neg":
            name = self.put(f"fneg {kinds[0]} {given[0]}")
        else:
            function = self.module.packed_intrinsic(INTRINSIC[op], len(given), WIDTH)
            arguments = ", ".join(f"{kind} {value}" for kind, value in zip(kinds, given, strict=True))
            name = self.put(f"call {self.wide} {function}({arguments})")
        self.vectors[members] = name
        return name

    def _operand(self, column: tuple[int, ...]) -> str:
        """The values of a column of nodes as one vector."""
        if column in self.vectors:
            return self.vectors[column]
        places = [self.packs.place.get(i) for i in column]
        computed = [place for place in places if place is not None and place[0] in self.packs.operands]
        if all(self.g.ops[i] == "const" for i in column):
            numbers = [self.target.literal(self.g.args[i][0], vector=False) for i in _padded(column)]
            return "<" + ", ".join(f"{self.target.real} {number}" for number in numbers) + ">"
        if len(computed) == len(column) and len({place[0] for place in computed}) <= 2:
            name = self._shuffled(column, computed)
        elif all(self._constant(i) for i in column):
            name = self._kept(column)
        elif len(set(column)) == 1:
            name = self._spread(column[0])
        else:
            name = self._gathered(self, column)
        self.vectors[column] = name
        return name

    def _constant(self, i: int) -> bool:
        """Whether the loop does not change node i: it was computed before it, or is a parameter."""
        if self.g.boolean(i):
            return False
        return (
            i in self.stored or self.g.ops[i] == "const" or (self.g.ops[i] == "in" and self.g.args[i][0] in ("p", "h"))
        )

    def _shuffled(self, column: tuple[int, ...], places: list[tuple[int, int]]) -> str:
        numbers = sorted({number for number, _ in places})
        vectors = [self._pack(self.packs.members[number]) for number in numbers]
        if len(numbers) == 1 and self.packs.members[numbers[0]] == column:
            return vectors[0]
        kind = self.kind(column[0])
        lanes = ", ".join(f"i32 {WIDTH * numbers.index(n) + lane}" for n, lane in _padded(tuple(places)))
        second = vectors[1] if len(vectors) > 1 else "poison"
        return self.put(f"shufflevector {kind} {vectors[0]}, {kind} {second}, <{WIDTH} x i32> <{lanes}>")

    def _spread(self, i: int) -> str:
        kind = self.kind(i)
        element = kind.split(" x ")[1].rstrip(">")
        one = self.put(f"insertelement {kind} poison, {element} {self.value(i)}, i32 0")
        return self.put(f"shufflevector {kind} {one}, {kind} poison, <{WIDTH} x i32> zeroinitializer")

    def _kept(self, column: tuple[int, ...]) -> str:
        """Put together once, before the loop, and loaded in it."""
        if column not in self.kept_vectors:
            slot = self.entry.put(f"alloca {self.wide}, align {WIDTH * self.target.size}")
            made = self._gathered(self.entry, column)
            self.entry.do(f"store {self.wide} {made}, ptr {slot}, align {WIDTH * self.target.size}")
            self.kept_vectors[column] = slot
        return self.put(f"load {self.wide}, ptr {self.kept_vectors[column]}, align {WIDTH * self.target.size}")

    def _gathered(self, body: Body, column: tuple[int, ...]) -> str:
        kind = self.kind(column[0])
        element, name = kind.split(" x ")[1].rstrip(">"), "poison"
        for lane, i in enumerate(_padded(column)):
            name = body.put(f"insertelement {kind} {name}, {element} {body.value(i)}, i32 {lane}")
        return name


def _padded(column: tuple) -> list:
    """Four entries, the first repeated."""
    return [column[k] if k < len(column) else column[0] for k in _LANES]
