"""The verdict in one sentence."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.stages.diagnose.which.found import Which
from schemas.people import share_of_gap
from schemas.results_diagnose import IN_WORDS, INDISTINCT

if TYPE_CHECKING:
    from r2s2r_cli.stages.diagnose.diagnosis import Diagnosis

SPELLED = 4
"""Names that a sentence holds; of more it says how many there are."""

_SEEN = "That changes what is seen, not what the robot does, so there is nothing to simulate"
ADVICE = {
    "camera_pose": f"{_SEEN}: set the camera up anew, and leave out what was recorded since.",
    "dropout": f"{_SEEN}: look for what hides the caps or loses frames.",
}
"""Of effects that change no prediction: what to do."""


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
    refit, floor = 1e3 * which.no_gap.rmse, 1e3 * which.no_gap.floor
    part = "" if which.no_gap.kept == 1.0 else f" on the best {100 * which.no_gap.kept:.0f} % of the intervals"
    if which.verdict == "no_gap":
        bound = f"upper 90 % bound {1e3 * (which.no_gap.upper or 0.0):.1f} mm"
        text = f"There is no gap above the floor: {refit:.1f} mm after refitting{part}, {bound}; floor {floor:.1f} mm."
        if best is not None and which.ranking[0] is best:
            text += f" Below it may hide {best.effect} (p = {best.probability:.2f})."
        return text
    if which.verdict == "unknown":
        where = "" if found.channel is None else f" It acts most like something in channel {found.channel}."
        if which.stranger is not None:
            where = f" The logs show it: {which.stranger.what}."
        return (
            f"Something is wrong that none of the effects looked for explains (p = {which.probability:.2f}): "
            f"{refit:.1f} mm at the end of an interval after refitting{part}, floor {floor:.1f} mm.{where}"
        )
    if which.verdict == "ambiguous" or best is None:
        first, *others = [_named(name) for name in which.set90]
        if not others:
            return f"These runs do not decide: {first} is the likeliest (p = {which.probability:.2f})."
        if len(which.set90) > SPELLED:
            p = {one.effect: one.probability for one in which.ranking}
            likely = ", ".join(f"{_named(name)} ({p.get(name, 0.0):.2f})" for name in which.set90[:3])
            return f"These runs do not decide: {len(which.set90)} names remain, the likeliest {likely}."
        between = f"{', '.join([first, *others[:-1]])} and {others[-1]}"
        return f"These runs do not decide between {between} (best p = {which.probability:.2f})."
    if which.verdict == "pair":
        return f"The gap has two causes, {' and '.join(which.effects)} (p = {which.probability:.2f})."
    anywhere = best.element is None or best.element.kind in ("world", "camera")
    element = "" if anywhere or best.element is None else f" at {best.element.words()}"
    onset = None if found.where is None else found.where.onset
    begins = "" if onset is None or onset.order == 0 else f", from interval {onset.interval} of {onset.run} on"
    advice = f" {ADVICE[best.effect]}" if best.effect in ADVICE else ""
    alike = _alike(which, best.effect)
    doubt = f" These runs cannot tell it from {' or '.join(alike)}." if alike else ""
    return f"The gap is caused by {best.effect}{element}{begins} (p = {which.probability:.2f}).{doubt}{advice}"


def _shrunk(found: Diagnosis) -> str:
    much = found.much
    if much is None or much.rmse("refit") is None or much.rmse("effect") is None:
        return ""
    names = " and ".join(much.effects)
    before, after = 1e3 * (much.rmse("refit") or 0.0), 1e3 * (much.rmse("effect") or 0.0)
    shrinks = much.share is not None and after < before
    if found.which.verdict in ("ambiguous", "unknown"):
        names = f"the likeliest {_of(found.which, much.effects)}, {names},"
    count = len(much.names)
    some = f"{count - len(much.set_aside)} of " if much.set_aside else ""
    held = f" On {some}{count} held-out interval{'s' * (count != 1)}{' of the same run' if much.within_run else ''}"
    text = (
        f"{held} {names} takes the key-frame error from {before:.1f} to {after:.1f} mm (floor {1e3 * much.floor:.1f})"
    )
    if much.share is None:
        return text + ": the refit error is at the floor, so there is no share to speak of."
    if not shrinks:
        was = much.rmse("nominal")
        beside = "" if was is None or 1e3 * was >= after else f"; as identified it is {1e3 * was:.1f} mm"
        return f"{text}: it closes none of the gap{beside}."
    wide = "" if much.ci90 is None else f" ({round(100 * much.ci90[0])} .. {round(100 * much.ci90[1])})"
    told = "" if much.predicted is None else f"; predicted to close {share_of_gap(much.predicted)}"
    text += f", which closes {round(100 * much.share)} %{wide} of the gap above the floor{told}"
    if much.ci90 is not None and much.ci90[0] <= 0.0:
        text += "; that it helps is not shown, so do not act on it yet"
    return f"{text}."


def _of(which: Which, fitted: tuple[str, ...]) -> str:
    """What the effect that was measured is the likeliest of: one that no replay tells may be likelier."""
    return "effect" if which.best is None or which.best.effect in fitted else "of the effects that were fitted"


def _alike(which: Which, name: str) -> list[str]:
    """Effects that predict the same and are nearly as probable: one of a size of next to nothing predicts what any
    does."""
    near = [b if a == name else a for a, b, nats in which.confusable if name in (a, b) and nats < INDISTINCT]
    least = np.exp(-INDISTINCT) * which.probability
    return [one.effect for one in which.ranking if one.effect in near and one.probability >= least]


def _named(name: str) -> str:
    return IN_WORDS.get(name, name)
