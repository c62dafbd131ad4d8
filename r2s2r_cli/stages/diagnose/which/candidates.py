"""Hypotheses: every effect of the catalogue, at every element where it can sit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from r2s2r_cli.engine.hooks import Hooks
from r2s2r_cli.stages.diagnose.parity.finding import Element
from r2s2r_cli.stages.diagnose.which.numbers import Model
from schemas.results_diagnose import NO_REPLAY

KIND = {"rod": "rod", "cap": "cap", "cable": "cable", "actuated": "motor", "sensor": "sensor"}
"""Kind of the element, by what a parameter is counted `per`."""
STEP = 1.0
"""Size, in scales of a number, at which responses are tried, to both sides of off; the screening takes shares of it."""
AZIMUTHS = 6
"""Directions in which the far end of something is tried."""
LINES = 3
"""Directions in which a line through a place is tried."""
SAME_AS_NUISANCE = ("motor_speed_mismatch", "cap_friction", "tendon_stiffness", "tendon_set")
"""Effects that are a nuisance where all elements have them alike."""
PASSIVE_ONLY = ("tendon_set",)
"""Effects that a winch makes up for: nobody sees what the rest length of a winched cable is off by."""
PATCH = {"patch_x_m", "patch_y_m"}
LINE = {"ridge_distance_m", "ridge_angle_rad"}
ANCHOR = {"anchor_x_m", "anchor_y_m"}
"""Numbers that together say where on the floor an effect sits."""
PARTS = {
    "friction_field": (("gradient_x_per_m", "gradient_y_per_m"),
                       ("patch_factor", "patch_x_m", "patch_y_m", "patch_radius_m")),
    "sensor_saturation": (("top_share", "top_m"), ("bottom_share", "bottom_m")),
}  # fmt: skip
"""Effects that are several laws, each a candidate of its own."""


@dataclass(frozen=True)
class Candidate:
    """One effect at one element. spread: of each of its free numbers the places among those of the model, several where
    all elements share it. off, lower, upper, scale: (k,). tries: sizes (t, k) at which it is tried first. shape (k,):
    numbers that only say where or how, and nothing while the others are off. origin (k,): where the refit nominal model
    has it, off unless it is a nuisance as well."""

    effect: str
    channel: str
    element: Element | None
    spread: tuple[tuple[int, ...], ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    off: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    scale: np.ndarray
    tries: np.ndarray
    shape: np.ndarray
    origin: np.ndarray

    def share(self, size: np.ndarray, share: float) -> np.ndarray:
        """A size (k,) that share of the way from the origin, at the same place."""
        return np.where(self.shape, size, self.origin + share * (size - self.origin))

    @property
    def number(self) -> int | None:
        """Index of its element; None: it has none, or all of the kind."""
        return None if self.element is None else self.element.index

    @property
    def label(self) -> str:
        """`cap_friction, cap 3`; of a part of an effect with the name of its first number."""
        part = f" ({self.names[0].split('.')[1]})" if self.effect in PARTS else ""
        return self.effect + part + ("" if self.element is None else f", {self.element.words()}")


def candidates(
    model: Model,
    starts: Mapping[str, Mapping[str, float]] | None = None,
    places: np.ndarray | None = None,
    values: np.ndarray | None = None,
) -> tuple[Candidate, ...]:
    """All of them, in the order of the catalogue. Effects that the nominal simulator has already are left out.

    starts: sizes that other stages suspect, by effect and own parameter (`Parity.starts`), tried as well. places (n, 2)
    [m]: where caps touched the ground; what sits somewhere is tried there. values (n,): of the refit nominal model;
    None: effects are off there.
    """
    touched = np.zeros((1, 2)) if places is None or not len(places) else places
    found: list[Candidate] = []
    for effect in model.effects:
        all_places = model.off(effect.name)
        if effect.name in NO_REPLAY or any(model.values0[k] != model.numbers[k].off for k in all_places):
            continue
        suggested = (starts or {}).get(effect.name, {})
        by_field: dict[str, list[int]] = {}
        for k in all_places:
            by_field.setdefault(model.numbers[k].field.split(".", 1)[1], []).append(k)
        parts = PARTS.get(effect.name, (tuple(by_field),))
        for names in parts:
            fields = {name: by_field[name] for name in names}
            for element, spread in _elements(model, effect, fields):
                found.append(_candidate(model, effect, element, spread, suggested, touched, values))
    return tuple(found)


def _elements(
    model: Model, effect: Hooks, fields: Mapping[str, Sequence[int]]
) -> list[tuple[Element | None, tuple[tuple[int, ...], ...]]]:
    """The elements, each with the places of its numbers; first all of them together, where that is another effect."""
    per = {one.name: one.per for one in effect.own}  # type: ignore[attr-defined]
    counted = next((per[name] for name in fields if per[name] != "robot"), None)
    if counted is None:
        return [(None, tuple(tuple(places) for places in fields.values()))]
    count = max(len(places) for places in fields.values())
    found: list[tuple[Element | None, tuple[tuple[int, ...], ...]]] = []
    if effect.name not in SAME_AS_NUISANCE and counted != "rod":
        found.append((Element(KIND[counted]), tuple(tuple(places) for places in fields.values())))
    for i in range(count):
        number = model.robot.actuated[i] if counted == "actuated" else i
        if effect.name in PASSIVE_ONLY and i in model.robot.actuated:
            continue
        own = tuple((places[i],) if len(places) > 1 else tuple(places) for places in fields.values())
        found.append((Element(KIND[counted], number), own))
    return found


def _candidate(
    model: Model, effect: Hooks, element: Element | None, spread: tuple[tuple[int, ...], ...],
    suggested: Mapping[str, float], touched: np.ndarray, values: np.ndarray | None,
) -> Candidate:  # fmt: skip
    numbers = [model.numbers[places[0]] for places in spread]
    keys = [number.field.split(".", 1)[1] for number in numbers]
    alone = [places for places in spread if len(places) == 1]
    names = tuple(n.name if places in alone else n.field for n, places in zip(numbers, spread, strict=True))
    off, lower, upper, scale = (
        np.array([getattr(n, key) for n in numbers]) for key in ("off", "lower", "upper", "scale")
    )
    origin = off if values is None else values[[places[0] for places in spread]]
    shape = np.array([n.only_shape for n in numbers])
    tries = _tries(keys, shape, origin, scale, touched)
    for k, number in enumerate(numbers):
        tries += [np.where(np.arange(len(origin)) == k, value, origin) for value in number.tried]
    known = {name.split(".", 1)[1]: k for k, name in enumerate(names)}
    given = [(known[name], value) for name, value in suggested.items() if name in known]
    if given:
        row = origin.copy()
        for k, value in given:
            row[k] = origin[k] + value - off[k]
        tries.insert(0, row)
    return Candidate(
        effect=effect.name, channel=str(effect.channel), element=element, spread=spread, names=names,  # type: ignore[attr-defined]
        units=tuple(n.unit for n in numbers), off=off, lower=lower, upper=upper, scale=scale,
        tries=_distinct(tries, ~shape, origin, lower, upper, scale), shape=shape, origin=origin,
    )  # fmt: skip


def _tries(
    keys: Sequence[str], only_shape: np.ndarray, origin: np.ndarray, scale: np.ndarray, touched: np.ndarray
) -> list[np.ndarray]:
    """Sizes: the numbers that do something alone, to both sides; with them, those that only say where or how."""
    shape, sizes = np.flatnonzero(only_shape), np.flatnonzero(~only_shape)
    axes = np.eye(len(origin))
    rows = [origin + sign * STEP * scale * axes[k] for k in sizes for sign in (1.0, -1.0)]
    if 1 < len(sizes) <= 3:
        for signs in product((1.0, -1.0), repeat=len(sizes)):
            row = origin.copy()
            row[sizes] += np.array(signs) * scale[sizes]
            rows.append(row)
    placed: list[np.ndarray] = []
    for row in rows if len(shape) else ():
        placed += _shaped(row, keys, shape, origin, scale, touched)
    return [*(() if _has_place(keys) else rows), *placed]


def _has_place(keys: Sequence[str]) -> bool:
    """Whether it sits somewhere on the floor: tried where the robot was, and nowhere else."""
    return any(keys_of <= set(keys) for keys_of in (PATCH, LINE, ANCHOR))


def _shaped(
    row: np.ndarray, keys: Sequence[str], shape: np.ndarray, off: np.ndarray, scale: np.ndarray, touched: np.ndarray
) -> list[np.ndarray]:
    """The size `row` at several places."""
    at = {key: k for k, key in enumerate(keys)}
    found = []
    if at.keys() >= PATCH:
        for x, y in touched:
            one = row.copy()
            one[at["patch_x_m"]], one[at["patch_y_m"]] = x, y
            found.append(one)
    elif at.keys() >= LINE:
        for x, y in touched:
            for angle in np.pi * np.arange(LINES) / LINES:
                one = row.copy()
                one[at["ridge_distance_m"]] = x * np.cos(angle) + y * np.sin(angle)
                one[at["ridge_angle_rad"]] = angle
                found.append(one)
    elif at.keys() >= ANCHOR:
        middle = touched.mean(axis=0)
        for angle in 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS:
            one = row.copy()
            one[at["anchor_x_m"]] = middle[0] + np.cos(angle)
            one[at["anchor_y_m"]] = middle[1] + np.sin(angle)
            found.append(one)
    else:
        for k in shape:
            for sign in (1.0, -1.0):
                one = row.copy()
                one[k] = off[k] + sign * scale[k]
                found.append(one)
    return found


def _distinct(
    rows: Sequence[np.ndarray], sizes: np.ndarray, off: np.ndarray, lower: np.ndarray, upper: np.ndarray,
    scale: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Within the bounds, without what is off (in all its sizes) or there already, (t, k)."""
    found: list[np.ndarray] = []
    for row in rows:
        inside = np.clip(row, lower, upper)
        if np.any(np.abs(inside - off)[sizes] > 1e-3 * scale[sizes]) and not any(
            np.allclose(inside, one) for one in found
        ):
            found.append(inside)
    return np.array(found).reshape(-1, len(off))
