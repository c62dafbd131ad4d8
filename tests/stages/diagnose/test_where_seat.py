"""Where the cause sits: the committed name, the channel of most names, the probes; and where a cap reaches a place."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from r2s2r_cli.stages.diagnose.parity.finding import Element
from r2s2r_cli.stages.diagnose.where.found import SegmentGap
from r2s2r_cli.stages.diagnose.where.onset import reached
from r2s2r_cli.stages.diagnose.where.seat import Seat, seat
from r2s2r_cli.stages.diagnose.where.where import _onset
from r2s2r_cli.stages.diagnose.which.found import Ranked

RANKING = (
    Ranked("tendon_relaxation", 18.0, 0.22, "cable"),
    Ranked("cap_friction", 16.0, 0.21, "contact", Element("cap", 5)),
    Ranked("friction_field", 15.0, 0.20, "contact"),
    Ranked("sensor_gain", 9.0, 0.12, "sensing", Element("sensor", 3)),
    Ranked("sensor_bias", 8.0, 0.13, "sensing", Element("sensor", 2)),
    Ranked("none", 0.0, 0.12),
)


def _which(verdict: str, effects: tuple[str, ...] = ()) -> SimpleNamespace:
    return SimpleNamespace(verdict=verdict, effects=effects, ranking=RANKING, stranger=None)


WHERE = SimpleNamespace(channel="world", element=Element("rod", 1))


@pytest.mark.parametrize(
    ("verdict", "effects", "found"),
    [
        ("effect", ("sensor_gain",), Seat("sensing", Element("sensor", 3))),
        ("ambiguous", (), Seat("contact", Element("cap", 5))),
        ("unknown", (), Seat("world", Element("rod", 1))),
    ],
)
def test_the_seat_follows_what_was_concluded(verdict: str, effects: tuple[str, ...], found: Seat) -> None:
    """A committed name has its own seat whatever the probes say; of several the channel whose names are most probable
    together, not that of the first; without a name the probes'."""
    assert seat(_which(verdict, effects), WHERE) == found  # type: ignore[arg-type]


def test_below_the_floor_an_effect_that_is_likelier_than_nothing_has_a_place() -> None:
    """No size is claimed, but where what there is would act; where nothing is likelier, nothing is said of where."""
    likely = SimpleNamespace(verdict="no_gap", effects=(), ranking=RANKING)
    assert seat(likely, WHERE) == Seat("contact", Element("cap", 5))  # type: ignore[arg-type]
    for name in ("none", "unknown"):
        first = (Ranked(name, 0.0, 0.3), *RANKING)
        assert seat(SimpleNamespace(verdict="no_gap", effects=(), ranking=first), WHERE) == Seat()  # type: ignore[arg-type]


def test_logs_that_show_what_no_law_has_say_where() -> None:
    """Before the probes, which explain what they can."""
    which = _which("unknown")
    which.stranger = SimpleNamespace(channel="sensing", element=Element("sensor"))
    assert seat(which, WHERE) == Seat("sensing", Element("sensor"))  # type: ignore[arg-type]


def test_without_probes_the_names_say_where() -> None:
    """An error without a name, and probes that explain nothing or were not fitted: the channel of the nearest names."""
    silent = SimpleNamespace(channel=None, element=None)
    for where in (None, silent):
        assert seat(_which("unknown"), where).channel == "contact"  # type: ignore[arg-type]


def test_motor_and_cable_of_one_number_speak_for_the_same_string() -> None:
    """Motor 2 and cable 2 together outweigh cable 4, and the more probable of the two gives its kind."""
    names = (
        Ranked("a", 3.0, 0.4, "cable", Element("cable", 4)),
        Ranked("b", 2.0, 0.3, "cable", Element("cable", 2)),
        Ranked("c", 1.0, 0.25, "cable", Element("motor", 2)),
    )
    found = seat(SimpleNamespace(verdict="ambiguous", effects=(), ranking=names), None)  # type: ignore[arg-type]
    assert found.element == Element("cable", 2)
    # Of a robot whose motors wind cables 4 and 6 to 10, motor 2 is that of cable 7: three strings.
    passive = SimpleNamespace(verdict="ambiguous", effects=(), ranking=names)
    assert seat(passive, None, (4, 6, 7, 8, 9, 10)).element == Element("cable", 4)  # type: ignore[arg-type]


def _run(slides_at: int, *, speed: float) -> SimpleNamespace:
    """40 frames in four intervals; one of two caps, both on the floor, is over (1, 0) from frame `slides_at` on."""
    p, v = np.zeros((40, 2, 3)), np.zeros((40, 2, 3))
    p[..., 2] = 0.02
    p[slides_at:, 1, 0] = 1.0
    v[slides_at:, 1, 0] = speed
    caps = SimpleNamespace(name="g", p_WE=p, v_WE=v, sd_v=np.full_like(v, 1e-3), intervals=_Four(np.arange(0, 40, 10)))
    return SimpleNamespace(caps=caps)


class _Four:
    """Four intervals of ten frames."""

    def __init__(self, first: np.ndarray) -> None:
        self.first = first

    def __len__(self) -> int:
        return len(self.first)


def test_a_place_begins_where_a_cap_first_slides_over_it() -> None:
    """Never in the first run, in frame 25 of the second one: its third interval, the seventh of all. A cap that stands
    there, or passes above it, has not reached it."""
    runs = [_run(40, speed=0.1), _run(25, speed=0.1)]
    at = {"xy_m": (1.05, 0.0), "within_m": 0.1, "cap_radius": np.array([0.02, 0.02]), "gain": 5.0}
    found = reached(runs, **at)  # type: ignore[arg-type]
    assert found is not None
    assert (found.order, found.interval, found.run) == (6, 3, "g")
    assert reached([_run(25, speed=0.0)], **at) is None  # type: ignore[arg-type, list-item]
    high = _run(25, speed=0.1)
    high.caps.p_WE[..., 2] = 0.1
    assert reached([high], **at) is None  # type: ignore[arg-type, list-item]
    assert reached(runs, **{**at, "within_m": 0.04}) is None  # type: ignore[arg-type]


def test_no_place_begins_in_an_interval_that_is_judged() -> None:
    """A cap slides over it from frame 15 on, in intervals 2 to 4; where the second is judged the third is the first
    that may be looked at, and where all of them are nothing is known."""
    runs = [_run(15, speed=0.1)]
    at = {"xy_m": (1.05, 0.0), "within_m": 0.1, "cap_radius": np.array([0.02, 0.02]), "gain": 5.0}
    for judged, interval in (((), 2), ((("h", 2),), 2), ((("g", 2),), 3), ((("g", 2), ("g", 3)), 4)):
        found = reached(runs, **at, judged=judged)  # type: ignore[arg-type]
        assert found is not None and found.interval == interval and found.order == interval - 1
    assert reached(runs, **at, judged=[("g", k) for k in (2, 3, 4)]) is None  # type: ignore[arg-type]


def _compared(*elpd: np.ndarray) -> SimpleNamespace:
    """Fits of effects by themselves, the first of which stands first, and their densities over the refit nominal."""
    names = [f"effect{k}" for k in range(len(elpd))]
    fits = [SimpleNamespace(hypothesis=SimpleNamespace(effects=(name,), parts=(name,))) for name in names]
    scores = [SimpleNamespace(elpd=one) for one in elpd]
    best = SimpleNamespace(effect="effect0", element=None, size={})
    return SimpleNamespace(
        which=SimpleNamespace(best=best, verdict="effect"), fits=fits, scores=scores,
        refit=SimpleNamespace(elpd=np.zeros(len(elpd[0]))),
    )  # fmt: skip


def test_a_fall_that_is_hit_by_chance_does_not_hide_a_beginning() -> None:
    """An effect gains 3 nats in each interval from the 12th of 28 on, and 80 at a fall in the third: as in the ranking
    the fall counts 6 at most, so the beginning is found; and where another effect hits a fall in the 15th interval by
    500 nats, which the refit model does as badly, it is the same."""
    segments = tuple(
        SegmentGap("g", "g", k + 1, k, (k, k + 1.0), 1.0, 100.0, 0.5, False, 0.01, (0.0, 0.0)) for k in range(28)
    )
    mine, other = np.zeros(28), np.zeros(28)
    mine[11:], mine[2], other[14] = 3.0, 80.0, 500.0
    for compared in (_compared(mine), _compared(mine, other)):
        found = _onset(SimpleNamespace(judge=()), segments, None, compared, 0, None)  # type: ignore[arg-type]
        assert found is not None and found.interval == 12
