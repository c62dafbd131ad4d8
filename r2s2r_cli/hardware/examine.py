"""What a link is worth: listen to a robot at rest for a few seconds, motors off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from r2s2r_cli.devices.lengths import not_initialised
from r2s2r_cli.devices.link import LinkFacts, LinkStatistics, RobotLink


@dataclass(frozen=True)
class LinkHealth:
    """Of `seconds` [s] of listening. rates: samples a second by board. median, noise: of every sensor [F], (sensor,),
    noise is the standard deviation of one reading from the next over root 2; NaN: never received. not_set_up: sensors
    that send 0.20 pF. ticks: control ticks a second. voltage [V]: the last, None: not told.
    """

    facts: LinkFacts
    statistics: LinkStatistics
    seconds: float
    rates: dict[int, float]
    ticks: float
    median: np.ndarray
    noise: np.ndarray
    not_set_up: tuple[int, ...]
    voltage: float | None


def examine(link: RobotLink, motors: int, seconds: float) -> LinkHealth:
    """Listen to an open link, answering every control tick with zeros. Raises LinkError, SafetyStop."""
    start = link.now()
    counts: dict[int, int] = {}
    rows: list[np.ndarray] = []
    due, voltage = 0, None
    while (passed := link.now() - start) < seconds:
        sample = link.read(min(0.1, seconds - passed))
        if sample is None:
            continue
        if sample.due:
            due += 1
            link.command(np.zeros(motors))
        counts[sample.board] = counts.get(sample.board, 0) + 1
        rows.append(np.where(sample.fresh, sample.capacitance, np.nan))
        voltage = sample.voltage if sample.voltage is not None else voltage
    passed = link.now() - start
    columns = [column[np.isfinite(column)] for column in np.array(rows).T] if rows else []
    return LinkHealth(
        facts=link.facts, statistics=link.statistics, seconds=passed,
        rates={board: count / passed for board, count in sorted(counts.items())}, ticks=due / passed,
        median=np.array([np.median(column) if len(column) else np.nan for column in columns]),
        noise=np.array([np.diff(column).std() / np.sqrt(2) if len(column) > 2 else np.nan for column in columns]),
        not_set_up=tuple(i for i, column in enumerate(columns)
                         if len(column) and not_initialised(column).all()),
        voltage=voltage,
    )  # fmt: skip
