"""Packs: nodes of one program that do the same for equal parts, and can be one vector instruction.

A program of one environment is a program on single numbers, but a robot has equal parts: what happens to three rods
happens three times. `twins` says which inputs are the same quantity of equal parts (engine/flat.py); from there packs
follow the program: nodes with the same operation on members of one pack are a pack again. Nothing is reordered within
a number, so results do not change by a bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from r2s2r_cli.engine.native.graph import Graph
from r2s2r_cli.engine.native.nodes import COMMUTATIVE

Twins = Sequence[tuple[tuple[str, int], ...]]
"""Groups of two to four inputs (kind, index) that are the same quantity of equal parts."""

WIDTH = 4
PACKABLE = frozenset({
    "add", "sub", "mul", "div", "fma", "neg", "sqrt", "abs", "min", "max", "select", "lt", "le", "eq", "and", "not",
    "det",
})  # fmt: skip
_FREE = frozenset({"neg", "det"})
_DEAR = frozenset({"div", "sqrt"})


class Packs:
    """Packs of a program: `members` by number, `place` of a node: (pack, lane), `operands` of a pack's instruction."""

    def __init__(self, g: Graph, order: Sequence[int], twins: Twins) -> None:
        self.g = g
        self.members: list[tuple[int, ...]] = []
        self.place: dict[int, tuple[int, int]] = {}
        self.operands: dict[int, list[tuple[int, ...]]] = {}
        self._leaves(order, twins)
        self._grow(g, order)

    def __bool__(self) -> bool:
        return bool(self.operands)

    def _leaves(self, order: Sequence[int], twins: Twins) -> None:
        at = {self.g.args[i]: i for i in order if self.g.ops[i] == "in"}
        for group in twins:
            nodes = tuple(at.get(one, -1) for one in group)
            if 2 <= len(group) <= WIDTH and all(i >= 0 and i not in self.place for i in nodes):
                self._add(nodes)

    def _add(self, nodes: tuple[int, ...]) -> int:
        number = len(self.members)
        self.members.append(nodes)
        for lane, i in enumerate(nodes):
            self.place[i] = (number, lane)
        return number

    def _grow(self, g: Graph, order: Sequence[int]) -> None:
        """Follow every pack, level by level: nodes that read its members, one each, and look alike otherwise.

        A node may read several packs. The youngest leads first: it is the most special one, a cable's rather than that
        of the rod it ends on; what finds no companions that way follows the others.
        """
        for level in _levels(g, order):
            for free in (False, True):
                for rank in range(3):
                    self._follow(self._left(level, free), rank)
                self._pair(self._left(level, free))

    def _left(self, level: Sequence[int], free: bool) -> list[int]:
        return [
            i for i in level if i not in self.place and (self.g.ops[i] in _FREE) == free and self.g.ops[i] in PACKABLE
        ]

    def _pair(self, level: Sequence[int]) -> None:
        """What combines parts (rod 0 with 1, 0 with 2, 1 with 2) has no lead: as it comes, if shuffling pays."""
        alike: dict[tuple[Any, ...], list[tuple[int, tuple[int, ...]]]] = {}
        for i in level:
            args = self._canonical(i)
            if args[0] in self.place:
                key = (self.g.ops[i], self.g.boolean(i), *map(self._kind, args))
                alike.setdefault(key, []).append((i, args))
        for group in alike.values():
            width = len(self.members[self.place[group[0][1][0]][0]])
            if len(group) % width == 0:
                for k in range(0, len(group), width):
                    some = group[k : k + width]
                    columns = [tuple(column) for column in zip(*(args for _, args in some), strict=True)]
                    if self._worth(self.g.ops[some[0][0]], columns):
                        self.operands[self._add(tuple(i for i, _ in some))] = columns

    def _follow(self, level: Sequence[int], rank: int) -> None:
        groups: dict[tuple[Any, ...], dict[int, tuple[int, tuple[int, ...]]]] = {}
        seen: dict[tuple[Any, ...], int] = {}
        for i in level:
            op, args = self.g.ops[i], self._canonical(i)
            leads = sorted({self.place[k] for k in args if k in self.place}, reverse=True)
            if rank >= len(leads):
                continue
            number, lane = leads[rank]
            key = (op, self.g.boolean(i), number, *map(self._kind, args))
            turn = seen.get((key, lane), 0)
            seen[key, lane] = turn + 1
            group = groups.setdefault((key, turn), {})
            group[lane] = (i, args)
            if len(group) == len(self.members[number]):
                self._complete(op, group)

    def _complete(self, op: str, group: dict[int, tuple[int, tuple[int, ...]]]) -> bool:
        """Make a pack of a group, its lanes in the order that needs the least shuffling; the oldest pack's on a tie."""
        lanes = [group[k] for k in range(len(group))]
        if any(i in self.place for i, _ in lanes):
            return False
        best: tuple[int, int, tuple[int, ...], list[tuple[int, ...]]] | None = None
        for position in range(len(lanes[0][1])):
            column = [args[position] for _, args in lanes]
            places = [self.place[k] for k in column if k in self.place]
            if len(places) < len(lanes) or len({number for number, _ in places}) > 1:
                continue
            if sorted(lane for _, lane in places) != list(range(len(lanes))):
                continue
            ordered = [one for _, one in sorted(zip(places, lanes, strict=True))]
            columns = [tuple(column) for column in zip(*(args for _, args in ordered), strict=True)]
            rank = (sum(map(self.ways, columns)), places[0][0], tuple(i for i, _ in ordered), columns)
            best = rank if best is None or rank[:2] < best[:2] else best
        if best is None or not self._worth(op, best[3]):
            return False
        self.operands[self._add(best[2])] = best[3]
        return True

    def _canonical(self, i: int) -> tuple[int, ...]:
        """Arguments with those of packs first where the operation allows it: lanes then agree in their order."""
        op, args = self.g.ops[i], tuple(self.g.args[i])
        swappable = 2 if op in COMMUTATIVE or op == "fma" else 0
        first = sorted(args[:swappable], key=lambda k: (k not in self.place, self.place.get(k, (0, 0))[0]))
        return (*first, *args[swappable:])

    def _kind(self, k: int) -> tuple[Any, ...]:
        if k in self.place:
            return ("pack", self.place[k][0])
        return ("const", self.g.args[k][0]) if self.g.ops[k] == "const" else ("single",)

    def _worth(self, op: str, columns: Sequence[tuple[int, ...]]) -> bool:
        """Whether the vector instruction costs less than the numbers it replaces, its operands brought together."""
        cost = 0
        for column in columns:
            ways = self.ways(column)
            if ways > 2 and self.g.boolean(column[0]):
                return False  # truth values live in mask registers, where lanes are dear
            cost += ways
        return cost <= len(columns[0]) * (4 if op in _DEAR else 1)

    def ways(self, column: tuple[int, ...]) -> int:
        """Instructions that bring these values into one vector, about."""
        if len(set(column)) == 1:
            return 0
        if any(k not in self.place for k in column):
            constant = all(self.g.ops[k] in ("const", "in") for k in column)
            return 1 if constant else len(column)
        numbers = {self.place[k][0] for k in column}
        if len(numbers) == 1:
            exact = self.members[next(iter(numbers))] == column
            return 0 if exact else 1
        return 2 if len(numbers) == 2 else len(column)

    def dissolve(self, number: int) -> None:
        """Take a pack apart again."""
        for i in self.members[number]:
            del self.place[i]
        del self.operands[number]


def _levels(g: Graph, order: Sequence[int]) -> list[list[int]]:
    """Nodes by the longest way from the inputs: those of equal parts are on one level, after all that they read.

    Signs do not count: a cable pulls one rod up and the other down.
    """
    level: dict[int, int] = {}
    found: list[list[int]] = []
    for i in order:
        level[i] = max((level[k] for k in g.arguments(i) if k in level), default=-1) + (g.ops[i] not in _FREE)
        # Calls come one after the other, one a pair of parts: their results count as inputs, else no two were level.
        level[i] = 0 if g.ops[i] in ("call", "get") else max(level[i], 0)
        while len(found) <= level[i]:
            found.append([])
        found[level[i]].append(i)
    return found
