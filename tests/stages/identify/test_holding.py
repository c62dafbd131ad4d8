"""What the data do not show of an effect: it is off, whatever a fit begins with, and the rest is fitted without it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from r2s2r_cli.effects import CATALOGUE, FURTHER
from r2s2r_cli.stages.identified import identified
from r2s2r_cli.stages.identify import holding as module, online
from r2s2r_cli.stages.identify.before import specs_of
from r2s2r_cli.stages.identify.data import Selection
from r2s2r_cli.stages.identify.effects_asked import effects_kept
from r2s2r_cli.stages.identify.fit import fit
from r2s2r_cli.stages.identify.found import ParameterFound
from r2s2r_cli.stages.identify.free import Free, select
from r2s2r_cli.stages.identify.free.catalogue import catalogue, entries
from r2s2r_cli.stages.identify.groups import identification
from r2s2r_cli.stages.identify.holding import fitted_to_shown, held_at, holding, holding_effects
from r2s2r_cli.stages.identify.kept import Kept
from r2s2r_cli.stages.identify.online import Known, drifted
from r2s2r_cli.stages.identify.recipe import Recipe
from r2s2r_cli.stages.identify.request import Request
from r2s2r_cli.stages.identify.residuals import FIXED_SD, CapResiduals
from r2s2r_cli.stages.identify.task import Task
from r2s2r_cli.stages.identify.training import training_windows
from r2s2r_cli.stages.identify.trust.identifiability import Trust
from r2s2r_cli.stages.identify.trusted import held_as
from schemas.config import IdentifySettings
from tests.stages.identify.planted import found
from tests.stages.identify.replayed import predictor_of, start, walk
from tests.support.engine import threebar

RATIO, ANGLE = "friction_anisotropy.ratio", "friction_anisotropy.angle_rad"
LAG, HEIGHT = "motor_lag.tau_s", "obstacle.height_m"
NAN = (math.nan, math.nan)
SHOWN, HIDDEN = Trust.IDENTIFIED, Trust.NOT_IDENTIFIABLE
BARE: dict[str, Any] = {
    "covariance": None, "information": None, "trace": (), "starts": (), "profiles": (), "updates": (),
}  # fmt: skip


def free(*specs: str) -> tuple[Free, ...]:
    """Of the three-bar robot."""
    return select(specs, threebar())


def task() -> Task:
    """Of which nothing is asked but what is held."""
    nothing: Any = None
    return Task(nothing, (), nothing, IdentifySettings())


class Shown:
    """A predictor with these numbers, and what the data say of them: dead and hidden by name, else shown; `without`:
    what is dead once a number is held."""

    def __init__(
        self, frees: Sequence[Free], *, hidden: Sequence[str] = (), dead: Sequence[str] = (),
        without: dict[str, Sequence[str]] | None = None,
    ) -> None:  # fmt: skip
        self.mapping = SimpleNamespace(frees=tuple(frees), names=tuple(one.name for one in frees))
        self.facts = {"hidden": hidden, "dead": dead, "without": without or {}}

    def starting(self, frees: Sequence[Free]) -> Shown:
        """As of a Predictor."""
        return Shown(frees, **self.facts)  # type: ignore[arg-type]

    def told(self, held: Sequence[str]) -> Any:
        """As an Identifiability."""
        gone = {name for one in held for name in self.facts["without"].get(one, ())}  # type: ignore[attr-defined]
        dead = {*self.facts["dead"], *gone}
        names = self.mapping.names
        unknown = {*self.facts["hidden"], *dead, *held}
        return SimpleNamespace(names=names, trust=tuple(HIDDEN if name in unknown else SHOWN for name in names),
                               no_effect=tuple(name for name in names if name in dead))  # fmt: skip


@pytest.fixture(autouse=True)
def looks(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, ...]]:
    """What was held each time that somebody asked what the data say."""
    asked: list[tuple[str, ...]] = []

    def known(own: Task, predictor: Any, *, refuse: bool = True) -> Any:
        asked.append(own.held)
        return predictor.told(own.held)

    monkeypatch.setattr(module, "known_before", known)
    return asked


def test_every_number_of_an_effect_has_a_prior_about_off() -> None:
    """Wherever its fit begins; of the robot's own numbers the prior is about robot.toml's value."""
    own = {f"{effect.name}.{one.name}": one for effect in (*CATALOGUE, *FURTHER) for one in effect.own}
    seen = 0
    for entry in entries(threebar()).values():
        if not entry.effect:
            assert entry.free.off is None and entry.free.mean == entry.free.start
            continue
        known = own[entry.family]
        assert entry.free.mean == known.off and entry.free.shape == known.only_shape
        assert entry.free.lower <= entry.free.mean <= entry.free.upper
        seen += entry.free.mean != entry.free.start
    assert seen > 20


def test_whoever_says_where_it_begins_says_what_it_is_thought_to_be() -> None:
    """And bounds without off leave no place to hold it at but its start."""
    plain, told, beyond = (free(spec)[0] for spec in (RATIO, f"{RATIO}=1.2", f"{RATIO},1.1..1.5"))
    assert (plain.start, plain.mean) == (1.15, 1.0)
    assert (told.start, told.mean) == (1.2, 1.2)
    assert (beyond.start, beyond.mean) == (1.15, 1.15)
    learned = drifted(plain, Known({RATIO: 1.3}, {RATIO: 0.01}))
    assert (learned.start, learned.mean) == (1.3, 1.3)


def test_it_is_held_where_it_is_off_and_said_so() -> None:
    """An effect that is hidden, at 1 where its fit would begin at 1.15; friction at its start, as ever; what is shown
    stays free. Only where an effect was held the data are asked once more."""
    frees = free("motor_speed", "friction", RATIO, LAG)
    made, begun, _ = holding(task(), Shown(frees, hidden=("friction", RATIO)))  # type: ignore[arg-type]
    assert made.held == ("friction", RATIO)
    assert [one.start for one in begun.mapping.frees] == [frees[0].start, frees[1].start, 1.0, frees[3].start]
    assert [held_as(one) for one in begun.mapping.frees[1:3]] == [
        "held at its start", "held at 1, which is off; prior sd 0.3",
    ]  # fmt: skip


def test_methods_that_hold_no_other_number_hold_effects() -> None:
    """Friction that is hidden stays free under its prior there; without effects nobody asks."""
    predictor: Any = Shown(free("friction", LAG), hidden=("friction", LAG))
    made, begun = holding_effects(task(), predictor)
    assert made.held == (LAG,) and begun.mapping.frees[1].start == 0.0
    plain: Any = Shown(free("friction", "motor_speed"), hidden=("friction",))
    assert holding_effects(task(), plain) == (task(), plain)


def test_what_an_effect_is_like_is_asked_where_the_effect_is_there(looks: list[tuple[str, ...]]) -> None:
    """Beside off no data show an angle: it stays free while the ratio is. Without the ratio it does nothing."""
    frees = free("friction", RATIO, ANGLE)
    like: Any = Shown(frees, hidden=(ANGLE,))
    assert holding(task(), like)[0].held == ()
    none: Any = Shown(frees, hidden=(RATIO, ANGLE), without={RATIO: (ANGLE,)})
    looks.clear()
    made, begun, _ = holding(task(), none)
    assert made.held == (RATIO, ANGLE) and looks == [(), (RATIO,)]
    assert [one.start for one in begun.mapping.frees[1:]] == [1.0, 0.0]


def test_a_fit_is_made_again_without_what_its_end_does_not_show() -> None:
    """Both numbers moved; the end shows the ratio alone; the second fit begins without the lag, with an empty trace
    and its own checkpoint, and an interrupted one is taken up there."""
    frees = free("friction", RATIO, LAG)
    tried = []

    def make(own: Task, predictor: Any) -> Any:
        tried.append((own.held, predictor.mapping.frees[2].start))
        kept.steps.append(len(tried))  # type: ignore[arg-type]
        return {*own.held, LAG}

    kept = Kept(None)
    kept.saved = {"round": 2}
    predictor: Any = Shown(frees)
    made, _ = fitted_to_shown(task(), predictor, make, lambda one: one, kept=kept)
    assert made.held == (LAG,)
    assert tried == [((), frees[2].start), ((LAG,), 0.0)]
    assert kept.saved == {} and kept.steps == [2] and kept.held

    tried.clear()
    kept.saved = {"held": [LAG]}
    fitted_to_shown(task(), predictor, make, lambda one: one, kept=kept)
    assert tried == [((LAG,), 0.0)]


def test_nothing_is_held_twice_and_users_starts_stay() -> None:
    """A number with a start of its own is one that somebody believes in: it is held there."""
    predictor: Any = Shown(free("friction", f"{LAG}=0.1"), hidden=(LAG,))
    made, begun, _ = holding(task(), predictor)
    assert made.held == (LAG,) and begun.mapping.frees[1].start == 0.1
    assert held_at(made, begun, ()) == (made, begun)


def problem(*held: str) -> CapResiduals:
    """A walk with an obstacle that nobody met, free beside motor speed."""
    predictor = predictor_of("motor_speed", HEIGHT, "obstacle.ridge_distance_m=1.5")
    frees = [replace(one, start=one.mean) if one.name in held else one for one in predictor.mapping.frees]
    predictor = predictor.starting(frees)
    train = (Selection("walk", (1, 2)),)
    values = np.array([one.start for one in frees])
    windows = training_windows([walk(2)], train, predictor, values, Recipe())
    return CapResiduals(predictor, windows, held=held)


def test_a_fit_begins_beside_the_mean_of_its_prior() -> None:
    """Free, the height begins above the floor with a prior about it; held, both are the floor."""
    one = catalogue(threebar())[HEIGHT]
    plain, held = problem(), problem(HEIGHT)
    assert (plain.z0[1], plain.prior_mean[1], plain.prior_sd[1]) == (one.start, 0.0, one.prior_sd)
    assert one.start > 0
    assert (held.z0[1], held.prior_mean[1], held.prior_sd[1]) == (0.0, 0.0, FIXED_SD)
    again = plain.starting(plain.frees)
    np.testing.assert_array_equal(again.z0, plain.z0)
    np.testing.assert_array_equal(again.prior_mean, plain.prior_mean)


@pytest.mark.parametrize("held", [(HEIGHT,), (HEIGHT, "motor_speed")])
def test_what_is_held_stays_to_the_last_bit(held: tuple[str, ...]) -> None:
    """Off exactly, on its bound, where all else moves or nothing does; the caps are those of a robot without the
    effect."""
    run = walk(3, values=(("motor_speed", 0.9),), noise=1e-3)
    train, recipe = (Selection("walk", (1, 2, 3)),), Recipe(noise=1e-3, filtered=1, max_iterations=4, held=held)
    plugged = predictor_of("motor_speed", HEIGHT)
    plugged = plugged.starting([replace(one, start=one.mean) for one in plugged.mapping.frees])
    from tests.support.variants import with_memory

    made = fit([run], train, plugged, recipe, known={"walk": with_memory(plugged.structure, start())})
    assert made.values[1] == 0.0
    assert made.values[0] == pytest.approx(0.8 if len(held) == 2 else 0.9, rel=0.01)
    bare = predictor_of("motor_speed")
    windows = training_windows([run], train, bare, made.values[:1], recipe, {"walk": start()})
    own = bare.predict(windows, made.values[:1])
    np.testing.assert_array_equal(made.problem.predict(made.solution.z).p_WE, own.p_WE)


def test_the_next_identification_looks_for_it_anew() -> None:
    """What was held without the effect gets no start from there: neither in the next iteration nor online, where off
    itself is a bound that no fit begins on. What was found is gone on from."""
    own = catalogue(threebar())
    lag, slope = own[LAG], own["ground_slope.angle_x_rad"]
    table = (
        ParameterFound(replace(lag, start=0.0), 0.0, 1e-9, 0.0, 0.0, NAN, HIDDEN, ""),
        ParameterFound(slope, 0.03, 0.001, 0.028, 0.032, NAN, SHOWN, ""),
    )
    request = replace(found().request, effects=("motor_lag", "ground_slope"))
    before = identification(found(request=request, parameters=table, **BARE))
    assert before.groups["parameters"]["prior_mean"].tolist() == [0.0, 0.0]
    assert before.groups["parameters"]["prior_sd"].tolist() == [lag.prior_sd, slope.prior_sd]
    kept = effects_kept(before, threebar())
    assert kept.specs == (LAG, "ground_slope.angle_x_rad=0.03")
    for specs in (kept.specs, tuple(specs_of(before, threebar()).values())):
        again, _ = select(specs, threebar())
        assert (again.start, again.mean, again.prior_sd) == (lag.start, 0.0, lag.prior_sd)


def test_draws_of_what_is_not_shown_lie_about_off() -> None:
    """As wide as the prior, cut at the bound; the first is the model as it was written."""
    lag = catalogue(threebar())[LAG]
    table = (ParameterFound(replace(lag, start=0.0), 0.0, 1e-9, 0.0, 0.0, NAN, HIDDEN, ""),)
    request = replace(found().request, effects=("motor_lag",))
    made = identification(found(request=request, robot=threebar().name, parameters=table, **BARE))
    drawn = identified(made, threebar()).draws(4001, seed=1)[:, 0]
    assert drawn[0] == 0.0
    assert np.mean(drawn > 1e-6) == pytest.approx(0.5, abs=0.03)
    assert np.sqrt(np.mean(drawn**2)) == pytest.approx(lag.prior_sd / math.sqrt(2.0), rel=0.05)


@pytest.mark.parametrize("last", [True, False])
def test_of_a_run_among_several_its_information_counts(monkeypatch: pytest.MonkeyPatch, last: bool) -> None:
    """Online a run of few windows reports no number, and the next goes on from what it says: only of the last, whose
    numbers are written down, what is reported as not identifiable is off."""
    frees = free("motor_speed", LAG)
    told = SimpleNamespace(
        parameters=tuple(ParameterFound(one, one.start, 0.1, 0.0, 1.0, NAN, HIDDEN) for one in frees),
        after=SimpleNamespace(names=tuple(one.name for one in frees), trust=(SHOWN, SHOWN)),
    )
    held = []

    def fit(*arguments: Any, **options: Any) -> Any:
        held.append(arguments[3].held)
        z = np.zeros(2)
        return SimpleNamespace(problem=SimpleNamespace(frees=frees), solution=SimpleNamespace(z=z))

    monkeypatch.setattr(online, "fit", fit)
    monkeypatch.setattr(online, "start_found", lambda *arguments: None)
    monkeypatch.setattr(online, "assured", lambda own, made: SimpleNamespace(made=made, sure=told))
    monkeypatch.setattr(Task, "predictor", lambda own, frees: Shown(frees))
    request = Request((Selection("walk", (1,)),))
    order = (Selection("walk", (1,)),) if last else (Selection("walk", (1,)), Selection("later", (1,)))
    online._fit_to(replace(task(), request=request), frees, Kept(None), (0, order))
    assert held == ([(), (LAG,)] if last else [()])
