"""The verdict in one sentence."""

from __future__ import annotations

from typing import TYPE_CHECKING

from r2s2r_cli.stages.diagnose.which.found import NONE, UNKNOWN

if TYPE_CHECKING:
    from r2s2r_cli.stages.diagnose.diagnosis import Diagnosis


def sentence(found: Diagnosis) -> str:
    """`The gap is caused by payload at rod 1 (p = 0.93): with it ...`."""
    which = found.which
    first = _verdict(found)
    if which.verdict == "no_gap":
        return first
    return first + _shrunk(found)


def _verdict(found: Diagnosis) -> str:
    which = found.which
    best = which.best
    refit, floor = 1e3 * which.no_gap.rmse, 1e3 * found.floor.rmse
    if which.verdict == "no_gap":
        bound = "" if which.no_gap.upper is None else f", upper 90 % bound {1e3 * which.no_gap.upper:.1f} mm"
        equivalent = "no gap above the floor" if which.no_gap.equivalent else "no effect stands out from chance"
        return f"There is {equivalent}: {refit:.1f} mm after refitting{bound}; floor {floor:.1f} mm."
    if which.verdict == "unknown":
        where = "" if found.channel is None else f" It acts most like something in channel {found.channel}."
        return (
            f"Something that is not in the catalogue is wrong: {refit:.1f} mm after refitting, floor {floor:.1f} mm, "
            f"and no named effect explains it (p = {which.probability:.2f}).{where}"
        )
    if which.verdict == "ambiguous" or best is None:
        names = ", ".join(_named(name) for name in which.set90)
        return f"These runs do not decide between {names} (best p = {which.probability:.2f})."
    if which.verdict == "pair":
        return f"The gap has two causes, {' and '.join(which.effects)} (p = {which.probability:.2f})."
    element = "" if best.element is None else f" at {best.element.words()}"
    return f"The gap is caused by {best.effect}{element} (p = {which.probability:.2f})."


def _shrunk(found: Diagnosis) -> str:
    much = found.much
    if much is None or much.rmse("refit") is None or much.rmse("effect") is None:
        return ""
    names = " and ".join(much.effects)
    before, after = 1e3 * (much.rmse("refit") or 0.0), 1e3 * (much.rmse("effect") or 0.0)
    count = len(much.names)
    held = f" On {count} held-out interval{'s' * (count != 1)}{' of the same run' if much.within_run else ''}"
    text = (
        f"{held} {names} takes the key-frame error from {before:.1f} to {after:.1f} mm (floor {1e3 * much.floor:.1f})"
    )
    if much.share is None:
        return text + ": the refit error is at the floor, so there is no share to speak of."
    wide = "" if much.ci90 is None else f" ({100 * much.ci90[0]:.0f} .. {100 * much.ci90[1]:.0f})"
    told = "" if much.predicted is None else f"; predicted {100 * much.predicted:.0f} %"
    return text + f", {100 * much.share:.0f} %{wide} of the gap above the floor{told}."


def _named(name: str) -> str:
    return {NONE: "no gap", UNKNOWN: "something unnamed"}.get(name, name)
