"""What the comparison of effects says: a ranking with probabilities, a verdict, and what cannot be told apart."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from r2s2r_cli.stages.diagnose.parity.finding import Element
from r2s2r_cli.stages.diagnose.parity.stranger import Stranger
from r2s2r_cli.stages.diagnose.which.left import Left
from r2s2r_cli.stages.diagnose.which.pair_share import TwoCauses
from r2s2r_cli.stages.diagnose.which.rivals import NoGap

NONE, UNKNOWN = "none", "unknown"
"""Names of a ranking that are no effects: nothing is wrong, and a cause that the catalogue does not have."""


@dataclass(frozen=True)
class Ranked:
    """One name in the ranking: an effect with its best element, `none` or `unknown`.

    gain: held-out log predictive density over the refit nominal model [nats]; marginal: log ratio of marginal
    likelihoods of all that was fitted [nats]; both less what healthy runs gain. size, ci90: of its numbers, by name, in
    `units`. moved: the fit left its start; on_bound: names of numbers that ended on a bound. rmse: of the caps at the
    ends of stretches left out [m]. misfit: squares over what noise and floor explain, median over stretches.
    gain_sd: of the gain, from how much what was left out differs in it [nats]. parity: what the parity stage says for
    it [nats]. fitted: False, the screening left it out, and it counts as gaining nothing. seen: whitened length [sd] of
    what its best seen element changes at the largest size that was tried, nuisances taken off; nan: no replay shows it.
    strain: what it costs that its nuisances are not where they were known to be [nats]; nan: it was not fitted.
    """

    effect: str
    gain: float
    probability: float
    channel: str | None = None
    element: Element | None = None
    size: Mapping[str, float] = field(default_factory=dict)
    ci90: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    moved: bool = True
    on_bound: tuple[str, ...] = ()
    rmse: float | None = None
    misfit: float | None = None
    gain_sd: float | None = None
    marginal: float = 0.0
    parity: float = 0.0
    fitted: bool = True
    seen: float = float("nan")
    strain: float = float("nan")
    others: tuple[tuple[Element, float], ...] = ()
    """Other elements of the effect that were fitted, with their gains."""


@dataclass(frozen=True)
class Shift:
    """A nuisance that an effect moves: refit alone it stood at `refit`, beside the effect at `beside`; sd of it."""

    name: str
    refit: float
    beside: float
    sd: float
    words: str


@dataclass(frozen=True)
class Screened:
    """One candidate of the screening: gain [nats], absorbed share, size of its response over the noise."""

    effect: str
    element: Element | None
    gain: float
    absorbed: float
    seen: float


@dataclass(frozen=True)
class Which:
    """verdict: effect | pair | ambiguous | no_gap | unknown. effects: ids it commits to. probability: of them;
    of `no_gap` the confidence of its bound. pairs: two effects at once, best first.
    set90: names that hold the truth (`Calibration.conformal`). ranking: best first. chance: gain that the best of the
    catalogue reaches by chance in one of twenty cases [nats]. wider: by how much the floor must grow to explain what
    the best effect leaves; unexplained: what that gains [nats]. left: what today's runs cost more than healthy ones.
    within: groups that were left out, in words. calibrated: where probabilities come from. stranger: what the logs
    show that no law of the catalogue has.
    """

    verdict: str
    effects: tuple[str, ...]
    probability: float
    set90: tuple[str, ...]
    ranking: tuple[Ranked, ...]
    screened: tuple[Screened, ...]
    no_gap: NoGap
    chance: float
    wider: float
    unexplained: float
    left: Left
    confusable: tuple[tuple[str, str, float], ...]
    not_testable: tuple[str, ...]
    shifts: tuple[Shift, ...]
    within: str
    calibrated: str
    warnings: tuple[str, ...] = ()
    pairs: tuple[TwoCauses, ...] = ()
    stranger: Stranger | None = None

    @property
    def best(self) -> Ranked | None:
        """The effect that stands highest, whatever the verdict."""
        return next((one for one in self.ranking if one.effect not in (NONE, UNKNOWN)), None)
