"""What tables and pictures of a diagnosis have in common: the verdict, what it accuses, which effect is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING

from r2s2r_cli.views.figure import RED

if TYPE_CHECKING:
    from schemas.results_diagnose import DiagnoseReport, ElementFound

MARKED, PLAIN = RED, "#8792a2"
"""Colours of what stands out or is named, and of what is not."""
RIVALS = ("none", "unknown")
"""Names of a ranking that are no effects."""
GUIDE = "docs/guides/diagnose.md"
"""Where verdicts are explained."""
_MEANS = {
    "effect": ("one effect of {pool} is the cause", "Use what was found"),
    "pair": ("two effects of {pool} are the cause", "Use what was found"),
    "ambiguous": (
        "no effect is likely enough to be named, nor is it shown that there is no gap",
        "What to do after `ambiguous`",
    ),
    "no_gap": ("the refit simulator is at the floor; what is smaller may still be there", "Verdicts"),
    "unknown": ("something is wrong that no effect of {pool} explains", "Verdicts"),
}
LOUD_SD = 4.0
"""Beyond which a finding of the logs is said beside a verdict that does not name it."""
LEFT_OUT = "left-out error"
"""Of fitted intervals, each predicted by a fit without it."""
HELD_OUT = "held-out error"
"""Of judged intervals, that were used for nothing before."""
TWO_ERRORS = (
    f"{LEFT_OUT}: of fitted intervals, each predicted by a fit without it; {HELD_OUT}: of the judged intervals, which "
    "were used for nothing before. They are of other intervals, each beside its own floor, so one may be at the floor "
    "and the other not"
)
NOT_OURS = "that of identify is another: repeats among its own segments"
"""Of the floor, of which people see two for the same runs."""
NATS = "the unit of evidence: what gains 1 nat makes the runs e = 2.7 times as likely, what gains 3 nats 20 times"
_WHY_NONE = (
    "a gain is what these runs say, before what is known beforehand. none gains nothing by definition: sets of known "
    "truth taught how much an effect must gain to be likelier. unknown has the share of causes that the catalogue "
    "lacks, whatever it gains: in calibration sets that gain did not tell such causes from others. It has more only "
    "where the best effect leaves far more than healthy runs do, or sensors are off as in no effect. So none may be "
    "likelier than unknown, which gains more"
)
_TOO_FEW = ". Beside the few effects that were asked for, that share of unknown is too little: they lack more causes"


def pool(*, only: bool) -> str:
    """What was chosen from. only: some effects that were asked for, and no others."""
    return "those asked for" if only else "the catalogue"


def why_none(*, only: bool) -> str:
    """Why probabilities of `none` and `unknown` do not follow their gains. only: as in `pool`."""
    return _WHY_NONE + (_TOO_FEW if only else "")


def verdict_words(report: DiagnoseReport, *, only: bool = False) -> str:
    """`ambiguous: no name is likely enough to be given (...)`: the word, its meaning, where to read on. only: as in
    `pool`."""
    means, chapter = _MEANS[report.verdict]
    return f"{report.verdict}: {means.format(pool=pool(only=only))} ({GUIDE}, chapter {chapter})"


def loud_words(report: DiagnoseReport) -> str:
    """What the logs say beyond LOUD_SD where the verdict names no cause and so does not speak of it; else empty."""
    # Nothing of a diagnosis from before they were noted.
    loud = [one for one in report.findings if one.sd is not None and abs(one.sd) > LOUD_SD]
    if report.verdict not in ("ambiguous", "no_gap") or not loud:
        return ""
    said = "; ".join(one.words for one in loud)
    in_vain = _in_vain(report, {one.effect for one in loud})
    return f"Yet the logs by themselves stand out by more than {LOUD_SD:g} sd: {said}.{in_vain}"


def _in_vain(report: DiagnoseReport, loud: set[str]) -> str:
    """Of the effects that the loud findings speak for, what the replay gains nothing by: else one would simulate it
    next."""
    gains = {one.effect: one.elpd_gain if one.marginal_nats is None else one.marginal_nats
             for one in report.ranking if one.effect in loud and one.fitted}  # fmt: skip
    idle = [f"{effect} ({gain:+z.1f} nats)" for effect, gain in gains.items() if gain <= 0.0]
    said = f" Simulating it does not help: the runs are predicted no better with {', nor with '.join(idle)}."
    return said if idle else ""


def commits(report: DiagnoseReport) -> bool:
    """Whether the verdict names a cause."""
    return report.verdict in ("effect", "pair")


def accused(report: DiagnoseReport) -> ElementFound | None:
    """The part that the verdict names; None where it names none."""
    return report.where.element if commits(report) else None


def undecided(report: DiagnoseReport) -> bool:
    """Whether the likeliest name is an effect to which the verdict does not commit."""
    first = report.ranking[0].effect if report.ranking else "none"
    return report.verdict == "ambiguous" and first not in RIVALS


def drawn_effects(report: DiagnoseReport) -> tuple[str, ...]:
    """Whose errors are stored beside those of the refit model for every fitted interval: what was committed to, else
    the first of the ranking that was fitted; empty where none was."""
    fitted = [one.effect for one in report.ranking if one.fitted and one.effect not in RIVALS]
    if report.effects and all(name in fitted for name in report.effects):
        return report.effects
    return tuple(fitted[:1])
