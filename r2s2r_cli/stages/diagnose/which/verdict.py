"""From scores to a verdict: what is committed to, what is only possible, and what these gaits cannot tell."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace

import numpy as np

from r2s2r_cli.stages.diagnose.parity.finding import Element
from r2s2r_cli.stages.diagnose.which.bounded import ENOUGH, ENOUGH_OF_TWO
from r2s2r_cli.stages.diagnose.which.calibration import Calibration
from r2s2r_cli.stages.diagnose.which.confusable import confusable
from r2s2r_cli.stages.diagnose.which.doubts import of_first, unheard, unwitnessed, warnings_of
from r2s2r_cli.stages.diagnose.which.found import NONE, UNKNOWN, Ranked, Screened, Shift, Which
from r2s2r_cli.stages.diagnose.which.hypothesis import Fit
from r2s2r_cli.stages.diagnose.which.material import Material
from r2s2r_cli.stages.diagnose.which.pair_share import TwoCauses, with_pairs
from r2s2r_cli.stages.diagnose.which.prior import strain
from r2s2r_cli.stages.diagnose.which.rivals import NoGap
from r2s2r_cli.stages.diagnose.which.score import Score, gain_sds, gains as gains_of
from r2s2r_cli.stages.diagnose.which.screen import Response
from schemas.results_diagnose import NO_REPLAY

NINETY = 1.645
LIKELY = 0.5
"""Probability from which an effect is likelier than not: then there is something to be found, however small."""
ALIKE = 4
"""Effects, the best, that are looked at for predicting the same."""
SHIFTED = 1.0
"""Posterior sd by which an effect moves a nuisance before it is worth saying."""


def concluded(m: Material) -> Which:
    """The verdict."""
    calibration = m.calibration
    order = sorted(range(len(m.fits)), key=lambda i: -float(m.marginal[i]))
    singles = [i for i in order if len(m.fits[i].hypothesis.parts) == 1]
    # Beside a pair that explains a piece both its first effect and nothing at all would lose the same there.
    gains = dict(zip(singles, _left_out_gains(m, singles, ENOUGH), strict=True))
    of_two = dict(enumerate(_left_out_gains(m, range(len(m.fits)), ENOUGH_OF_TWO)))
    worth = {
        i: calibration.score(m.fits[i].hypothesis.effects[0], float(m.marginal[i]), left_out=gains[i], parity=m.said(i))
        for i in singles
    }
    best: dict[str, int] = {}
    for i in sorted(singles, key=lambda i: -worth[i]):
        best.setdefault(m.fits[i].hypothesis.effects[0], i)
    others = _not_fitted(m, best)
    table = {name: worth[i] for name, i in best.items()}
    table |= {one.effect: calibration.score(one.effect, parity=one.parity) for one in others}
    table[NONE] = calibration.score(NONE)
    both = [_two(m, i, best, gains, of_two) for i in order if len(m.fits[i].hypothesis.parts) == 2]
    alone = {name: of_two[i] for name, i in best.items()}
    probability, pair = with_pairs(calibration.probabilities(table), both, alone, m.chance)
    lawless = m.stranger is not None
    probability = calibration.with_unknown(probability, m.unexplained, m.left.beyond, lawless=lawless)
    sds = dict(zip(singles, gain_sds(m.refit, [m.scores[i] for i in singles], m.groups).tolist(), strict=True))
    ranking = [
        replace(
            _ranked(m, i, gains[i], probability[name], singles, gains),
            gain_sd=sds[i],
            marginal=float(m.marginal[i]),
            parity=m.said(i),
        )
        for name, i in best.items()
    ]
    ranking += [replace(one, probability=probability[one.effect]) for one in others]
    ranking += [
        Ranked(
            NONE, 0.0, probability[NONE], rmse=m.no_gap.rmse, misfit=_misfit(m.refit), strain=strain(m.arena, m.base)
        ),
        Ranked(UNKNOWN, m.unexplained, probability[UNKNOWN]),
    ]
    shown = _shown(m.responses)
    ranking = [replace(one, seen=shown.get(one.effect, np.nan)) for one in ranking]
    ranking.sort(key=lambda one: (-one.probability, -one.marginal))
    logs = bool(m.parity)
    verdict, effects, p = verdict_of(
        ranking, calibration, pair, m.no_gap, left_sd=m.left.beyond, lawless=lawless, logs=logs
    )
    top = best.get(effects[0]) if effects else None
    return Which(
        verdict=verdict, effects=effects, probability=p, set90=calibration.within(probability), ranking=tuple(ranking),
        screened=tuple(
            Screened(r.candidate.effect, r.candidate.element, r.gain, r.absorbed, r.seen) for r in m.responses
        ),
        no_gap=m.no_gap, chance=m.chance, wider=m.wider, unexplained=m.unexplained, left=m.left,
        confusable=confusable(m, [i for i in best.values() if m.fits[i].moved][:ALIKE]),
        not_testable=_not_testable(m.responses), shifts=() if top is None else _shifts(m, m.fits[top]),
        within=_left_out(m), calibrated=calibration.words,
        warnings=(*unwitnessed(ranking, calibration, pair, logs=logs), *warnings_of(m, list(best.values()))),
        pairs=tuple(both), stranger=m.stranger,
    )  # fmt: skip


def _left_out_gains(m: Material, which: Sequence[int], enough: float) -> list[float]:
    """Of some fits, less what was there before."""
    found = gains_of(m.refit, [m.scores[i] for i in which], enough) - m.chronic[list(which)]
    return np.where(np.isnan(found), -np.inf, found).tolist()  # nan: all break off at one piece


def _two(
    m: Material, i: int, best: Mapping[str, int], gains: Mapping[int, float], of_two: Mapping[int, float]
) -> TwoCauses:
    """Of a fit of two effects, the first of which was fitted alone as well."""
    first, second = m.fits[i].hypothesis.effects
    alone = best[first]
    left_out = of_two[i] - of_two[alone]
    all_data = float(m.whole[i] - m.whole[alone])
    added = min(left_out, all_data) if np.isfinite([left_out, all_data]).all() else -np.inf
    return TwoCauses((first, second), gains[alone] + left_out, float(m.marginal[alone]) + all_data, added)


def _not_fitted(m: Material, fitted: Container[str]) -> list[Ranked]:
    """Effects that the screening left out, and those that change no prediction. They gain nothing, or lose what the
    screening says; for those that no replay tells the parity stage may speak all the same."""
    screened: dict[str, float] = {name: 0.0 for name in NO_REPLAY if m.asked is None or name in m.asked}
    for one in m.responses:
        if one.testable:
            name = one.candidate.effect
            screened[name] = max(screened.get(name, -np.inf), one.gain)
    return [
        Ranked(
            name,
            min(gain, 0.0),
            0.0,
            channel=_channel(name),
            fitted=False,
            parity=m.says(name),
        )
        for name, gain in screened.items()
        if name not in fitted
    ]


def _channel(name: str) -> str:
    from r2s2r_cli.effects.known import known_effects

    return next(str(effect.channel) for effect in known_effects() if effect.name == name)


def verdict_of(
    ranking: list[Ranked], calibration: Calibration, pair: tuple[str, ...] | None, gap: NoGap, *, left_sd: float = 0.0,
    lawless: bool = False, logs: bool = True,
) -> tuple[str, tuple[str, ...], float]:  # fmt: skip
    """What the first of the ranking is worth. Where the best effect leaves too much (left_sd, `Calibration.refuses`),
    or the logs show what no law has (lawless), that is a verdict of its own: no effect of the catalogue is enough. A
    name that nothing speaks for but what it was fitted to is none (`Calibration.witnessed`), alone or first of a pair:
    what both gain is no witness of either, and a pair needs what logs would show of both (`unheard`; logs: they were
    looked at). Where no cause is named, that there is no gap is a claim about its size (docs/concepts/measures.md), not
    about causes that hide below the floor."""
    first = ranking[0]
    named = first.effect not in (NONE, UNKNOWN) and calibration.witnessed(
        first.effect, first.gain, first.parity, first.marginal, logs=logs
    )
    if first.effect == UNKNOWN and (lawless or calibration.refuses(left_sd)):
        return "unknown", (), first.probability
    if named and pair is not None and first.effect in pair and not unheard(ranking, calibration, pair, logs=logs):
        p = of_first(ranking, pair)
        if calibration.commits(p):
            return "pair", pair, p
    if named and calibration.commits(first.probability):
        return "effect", (first.effect,), first.probability
    if gap.equivalent and not (named and first.probability >= LIKELY):
        return "no_gap", (), gap.sure
    return "ambiguous", (), first.probability


def _ranked(
    m: Material, i: int, gain: float, probability: float, singles: list[int], gains: dict[int, float]
) -> Ranked:
    fit, score = m.fits[i], m.scores[i]
    part = fit.hypothesis.parts[0]
    sd = score.sd[len(fit.z) :]
    low = np.maximum(fit.x - NINETY * sd, part.lower)
    high = np.minimum(fit.x + NINETY * sd, part.upper)
    others = [
        (m.fits[k].hypothesis.parts[0].element, gains[k]) for k in singles
        if k != i and m.fits[k].hypothesis.effects == fit.hypothesis.effects
    ]  # fmt: skip
    return Ranked(
        effect=part.effect, gain=gain, probability=probability, channel=part.channel, element=_element(fit),
        size=dict(zip(part.names, fit.x.tolist(), strict=True)),
        ci90={n: (float(a), float(b)) for n, a, b in zip(part.names, low, high, strict=True)},
        units=dict(zip(part.names, part.units, strict=True)), moved=fit.moved, on_bound=fit.on_bound,
        rmse=float(np.sqrt(np.nanmean(score.squared))), misfit=_misfit(score), strain=strain(m.arena, fit),
        others=tuple((element, g) for element, g in others if element is not None),
    )  # fmt: skip


def _element(fit: Fit) -> Element | None:
    """The element; an effect of the ground with a place in its numbers sits there."""
    part = fit.hypothesis.parts[0]
    if part.element is not None:
        return part.element
    own = {name.rsplit(".", 1)[-1]: float(v) for name, v in zip(part.names, fit.x, strict=True)}
    place = [own.get(key) for key in ("patch_x_m", "patch_y_m")]
    if None not in place:
        return Element("place", None, (float(place[0] or 0.0), float(place[1] or 0.0)))
    kind = {"observation": "camera", "world": "world"}.get(part.channel)
    return Element(kind) if kind else None


def _misfit(score: Score) -> float:
    return float(np.median(score.misfit))


def _shown(responses: tuple[Response, ...]) -> dict[str, float]:
    """How far every effect would be seen in these gaits, by the element that is seen best [sd]."""
    found: dict[str, float] = {}
    for one in responses:
        name, sd = one.candidate.effect, one.seen * float(np.sqrt(max(1.0 - one.absorbed, 0.0)))
        found[name] = max(found.get(name, 0.0), sd)
    return found


def _not_testable(responses: tuple[Response, ...]) -> tuple[str, ...]:
    seen: dict[str, bool] = {}
    for one in responses:
        seen[one.candidate.effect] = seen.get(one.candidate.effect, False) or one.testable
    return tuple(sorted(name for name, testable in seen.items() if not testable))


def _shifts(m: Material, fit: Fit) -> tuple[Shift, ...]:
    found = []
    for k in range(len(m.arena.engine)):
        name, sd = m.arena.names[k], max(float(m.refit.sd[k]), 1e-9)
        refit, beside = float(m.base.z[k]), float(fit.z[k])
        if abs(beside - refit) > SHIFTED * sd:
            number = m.arena.model.numbers[m.arena.engine[k]]
            if number.kind == "factor":
                alone, both = (round(100 * np.expm1(one)) for one in (refit, beside))
                told = f"{alone:+d} % without the effect, {both:+d} % beside it"
            else:
                told = f"{refit:.3g} {number.unit} without the effect, {beside:.3g} {number.unit} beside it"
            words = f"refitting had been hiding {fit.hypothesis.effects[0]} in {number.what}: {told}"
            found.append(Shift(name, refit, beside, sd, words))
    return tuple(found)


def _left_out(m: Material) -> str:
    count = len(np.unique(m.groups))
    if len(set(m.arena.gait.tolist())) > 1:
        return f"leave one gait out, {count} gaits"
    runs = {one.run for one in m.arena.many}
    return (
        f"leave one run out, {count} runs" if len(runs) > 1 else f"leave one interval out, {count} intervals of one run"
    )
