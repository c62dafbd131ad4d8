"""Where a line goes, and when: a board of the authors reads one datagram for each that it sends, and no more."""

from __future__ import annotations

from r2s2r_cli.devices.link import LinkError
from r2s2r_cli.hardware.codec.base import Outgoing
from r2s2r_cli.hardware.transport import Address


class Routes:
    """Addresses of the boards, and which of them may be sent a command now.

    A board that sends gets one answer: the command of the moment, or, where the controller has not made it yet, the
    next one as soon as it is there. So no queue grows in a board whose clock is slower than that of another.
    """

    def __init__(self) -> None:
        self._heard: dict[int, list[Address]] = {}
        self._any: Address | None = None
        self._may: set[Address] = set()
        self._owed: set[Address] = set()
        self._now: Outgoing | None = None

    def heard(self, source: Address | None, board: int | None = None) -> bytes | None:
        """A line came, from a board where it is a measurement; what to answer to it at once, if anything.

        Raises LinkError where a board speaks from an address that it had before it spoke from another: there are two.
        """
        if source is None:
            return None
        self._any = source
        if board is None:
            return None
        known = self._heard.setdefault(board, [])  # the last one is where it is
        if source in known[:-1]:
            raise LinkError(
                f"two robots send to this host: board {board} is heard from two addresses", where=f"board {board}",
                expected="one robot", received=f"{_place(known[-1])} and {_place(source)}",
                hint="r2s2r doctor ports   # once the other robot is switched off",
            )  # fmt: skip
        if source not in known:
            known.append(source)
        if self._now is not None and source in self._owed:
            self._owed.discard(source)
            return self._now.data
        self._may.add(source)
        return None

    def everywhere(self, line: Outgoing) -> list[Address | None]:
        """All places that a line must reach, at once: wherever a board was ever heard from."""
        if line.every_board and self._heard:
            return list(dict.fromkeys(place for places in self._heard.values() for place in places))
        return [self._any]

    def command(self, line: Outgoing, *, at_once: bool = False) -> list[Address | None]:
        """Places that may be sent a command now; the others get it as an answer. at_once: all of them."""
        places: list[Address | None] = [self._any]
        if line.every_board and self._heard:
            places = [*dict.fromkeys(known[-1] for known in self._heard.values())]
        if not line.every_board or at_once:
            return places
        self._now = line
        now = [place for place in places if place is None or place in self._may]
        self._owed = {place for place in places if place is not None} - self._may
        self._may.clear()
        return now

    def silence(self) -> None:
        """No answers until the next command."""
        self._now = None
        self._owed.clear()


def _place(address: Address) -> str:
    host, port = address
    return f"{host}:{port}"
