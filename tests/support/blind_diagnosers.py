"""Diagnosers for the machinery of the blind trials: one that only counts, one with a bug, two that cheat."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

from r2s2r_cli.blind import guard
from r2s2r_cli.stages.diagnose.evidence import Evidence
from tests.support.blind_bank import document


def sees(evidence: Evidence, settings: dict[str, Any]) -> dict[str, Any]:
    """No gap, as sure as it has frames."""
    frames = sum(len(run.caps.t) for run in evidence.runs)
    return document("no_gap", [], {"none": 1.0 - 1.0 / frames, "payload": 1.0 / frames})


def breaks(evidence: Evidence, settings: dict[str, Any]) -> dict[str, Any]:
    """Has a bug."""
    raise ZeroDivisionError("nothing to divide by")


def peeks(evidence: Evidence, settings: dict[str, Any]) -> dict[str, Any]:
    """Opens every label that it finds."""
    for path in _labels():
        path.read_bytes()
    return sees(evidence, settings)


def peeks_quietly(evidence: Evidence, settings: dict[str, Any]) -> dict[str, Any]:
    """The same, and hides that it was refused."""
    for path in _labels():
        with contextlib.suppress(guard.Peeked):
            path.read_bytes()
    return sees(evidence, settings)


def _labels() -> list[Path]:
    from r2s2r_cli.blind.run import _GUARDS

    bank = next(iter(_GUARDS.values())).bank
    return [bank / "labels" / f"{name}.sealed" for name in ("a", "b")]
