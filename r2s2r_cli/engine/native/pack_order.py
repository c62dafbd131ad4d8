"""The order in which packs and single nodes are emitted: all of a pack's members at once, after all that they read.

Packs that were found one by one may wait for each other; which of them to take apart is found here.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence

from r2s2r_cli.engine.native.packs import Packs
from r2s2r_cli.engine.native.passes import BUCKET


def units(packs: Packs, inside: Sequence[int], depth: dict[int, int]) -> list[tuple[int, ...]]:
    """What to emit, in order: packs as tuples, single nodes as tuples of one.

    Packs that wait for each other in a circle are taken apart.
    """
    while True:
        order, stuck = _sorted(packs, inside, depth)
        if not stuck:
            return order
        for number in stuck:
            packs.dissolve(number)


def _sorted(packs: Packs, inside: Sequence[int], depth: dict[int, int]) -> tuple[list[tuple[int, ...]], list[int]]:
    g, here = packs.g, set(inside)

    def unit(i: int) -> int:
        """Number of the unit of a node: negative for packs."""
        place = packs.place.get(i)
        return -1 - place[0] if place is not None and place[0] in packs.operands else i

    needs: dict[int, set[int]] = {}
    for i in inside:
        needs.setdefault(unit(i), set()).update(unit(k) for k in g.arguments(i) if k in here)
    readers: dict[int, list[int]] = {}
    for one, others in needs.items():
        others.discard(one)
        for other in others:
            readers.setdefault(other, []).append(one)
    when = {one: (depth[_first(packs, one)] // BUCKET, _first(packs, one)) for one in needs}
    left = {one: len(others) for one, others in needs.items()}
    ready = [(when[one], one) for one, n in left.items() if n == 0]
    heapq.heapify(ready)
    order: list[tuple[int, ...]] = []
    while ready:
        _, one = heapq.heappop(ready)
        order.append(packs.members[-1 - one] if one < 0 else (one,))
        for reader in readers.get(one, ()):
            left[reader] -= 1
            if left[reader] == 0:
                heapq.heappush(ready, (when[reader], reader))
    if len(order) == len(needs):
        return order, []
    return order, _circular(needs, {one for one in needs if left[one] > 0})


def _first(packs: Packs, one: int) -> int:
    return packs.members[-1 - one][0] if one < 0 else one


def _circular(needs: dict[int, set[int]], waiting: set[int]) -> list[int]:
    """The packs that hold up the others: those that lie on a circle found by going from need to need."""
    found: list[int] = []
    done: set[int] = set()
    for start in sorted(waiting):
        path, at = [], start
        while at not in done:
            done.add(at)
            path.append(at)
            at = min(need for need in needs[at] if need in waiting)
        if at in path:
            circle = [one for one in path[path.index(at) :] if one < 0]
            found.append(-1 - min(circle))
    return found
