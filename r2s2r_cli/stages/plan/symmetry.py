"""The symmetry group of a robot, from its geometry: which end caps can change places so that it is the same robot.

A symmetry is a permutation of the end caps that takes rods to equal rods and cables to equal cables (kind, stiffness,
rest length), and that a proper rotation of the rest shape does: mirrored robots are others. The 3-bar prism has six,
three turns about its principal axis and three half-turns that also change its two ends, one for each triangle that it
can stand on. With them one gait serves all triangles (paper, section "Developing Policies with Symmetry Reduction").
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from r2s2r_cli.errors import InputError
from r2s2r_cli.stages.calibrate.masses import mass_properties
from schemas.robot import Cable, Robot

SHAPE_TOLERANCE = 0.04
"""Share of the longest rod by which distances of caps may differ: rest poses are made by hand, or sag under gravity."""
EQUAL_TOLERANCE = 0.1
"""Relative difference of masses, lengths, stiffnesses and rest lengths of parts that count as equal."""


@dataclass(frozen=True)
class Symmetry:
    """One element: end cap i takes the place of caps[i]; rods, cables and motors (places in `Robot.actuated`) likewise.

    turn: rotation (3, 3) that takes the rest shape there, about its centroid, in the world of `rest_caps_m`. misfit_m:
    root mean square distance of the turned caps from those whose places they take.
    """

    caps: tuple[int, ...]
    rods: tuple[int, ...]
    cables: tuple[int, ...]
    motors: tuple[int, ...]
    turn: np.ndarray
    misfit_m: float

    def relabelled(self, targets: np.ndarray) -> np.ndarray:
        """Targets or commands (..., actuated) for the robot whose caps have changed places: what motor k did is now
        done by motor motors[k]."""
        changed = np.empty_like(targets)
        changed[..., list(self.motors)] = targets
        return changed


@dataclass(frozen=True)
class SymmetryGroup:
    """All symmetries of a robot, the identity first, then in the order of their cap permutations."""

    elements: tuple[Symmetry, ...]

    def __len__(self) -> int:
        return len(self.elements)

    def index(self, caps: tuple[int, ...]) -> int:
        """Number of the element with this permutation of caps; KeyError where there is none."""
        return {element.caps: k for k, element in enumerate(self.elements)}[caps]

    def product(self, first: int, then: int) -> int:
        """Number of the element that does `first`, and then `then`."""
        a, b = self.elements[first].caps, self.elements[then].caps
        return self.index(tuple(b[a[i]] for i in range(len(a))))

    def inverse(self, k: int) -> int:
        """Number of the element that undoes element k."""
        return self.index(tuple(int(i) for i in np.argsort(self.elements[k].caps)))

    def relative(self) -> np.ndarray:
        """Table (element, element): what takes a robot that has undergone the first to one that has undergone the
        second, in the labels of the first."""
        n = range(len(self))
        return np.array([[self.product(b, self.inverse(a)) for b in n] for a in n])

    def caps(self) -> np.ndarray:
        """Permutations of all elements, (element, cap)."""
        return np.array([element.caps for element in self.elements])

    def supports(self, caps: tuple[int, ...]) -> tuple[tuple[int, ...], ...]:
        """Where each element takes a set of caps, such as the support triangle; each ascending."""
        return tuple(tuple(sorted(element.caps[i] for i in caps)) for element in self.elements)


def symmetry_group(
    robot: Robot, *, shape_tolerance: float = SHAPE_TOLERANCE, equal_tolerance: float = EQUAL_TOLERANCE
) -> SymmetryGroup:
    """The proper symmetries of a robot's rest shape that keep rods and cables.

    shape_tolerance: of distances between caps, a share of the longest rod. equal_tolerance: of the numbers of equal
    parts, relative. Raises InputError where what was found is no group: the tolerance joins what is not alike.
    """
    p = np.array(robot.rest_caps_m)
    p = p - p.mean(axis=0)
    allowed = shape_tolerance * max(rod.length_m for rod in robot.rods)
    parts = _Parts(robot, equal_tolerance)
    found = []
    for caps in _isometries(p, allowed):
        rods = parts.rods(caps)
        cables = parts.cables(caps) if rods else None
        turn, misfit = _turn(p, p[list(caps)])
        if rods is None or cables is None or misfit > allowed:
            continue
        motors = tuple(robot.actuated.index(cables[k]) for k in robot.actuated)
        found.append(Symmetry(caps, rods, cables, motors, turn, misfit))
    group = SymmetryGroup(tuple(sorted(found, key=lambda element: element.caps)))
    known = {element.caps for element in group.elements}
    for a, b in product(known, known):
        if tuple(b[a[i]] for i in range(len(a))) not in known:
            raise InputError(
                "the rest shape is nearly symmetric, and not quite: its symmetries are no group",
                where="robot.toml: rest_caps_m, cables", expected="parts that are alike, or clearly not",
                received=f"{len(known)} permutations of end caps, two of which lead to another",
                hint="r2s2r validate robot.toml",
            )  # fmt: skip
    return group


def support_caps(p_WE: np.ndarray) -> tuple[int, ...]:
    """The three lowest caps of a resting pose p_WE (cap, 3) [m], ascending: its support triangle."""
    return tuple(sorted(int(i) for i in np.argsort(p_WE[:, 2], kind="stable")[:3]))


def principal_axis(p_WE: np.ndarray) -> np.ndarray:
    """Mean of the rods' unit axes, even to odd cap, of poses (..., cap, 3) [m]; (..., 3), not normalised."""
    axis = p_WE[..., 1::2, :] - p_WE[..., 0::2, :]
    return np.asarray((axis / np.linalg.norm(axis, axis=-1, keepdims=True)).mean(axis=-2))


class _Parts:
    """Rods and cables of a robot, and where a permutation of caps takes them; None where to parts that differ."""

    def __init__(self, robot: Robot, tolerance: float) -> None:
        self.robot = robot
        self.tolerance = tolerance
        self.bodies = [mass_properties(rod.parts) for rod in robot.rods]
        self.by_ends: dict[frozenset[int], list[int]] = {}
        for k, cable in enumerate(robot.cables):
            self.by_ends.setdefault(frozenset(cable.caps), []).append(k)

    def rods(self, caps: tuple[int, ...]) -> tuple[int, ...] | None:
        taken = []
        for rod, own in enumerate(self.robot.rods):
            even, odd = caps[2 * rod], caps[2 * rod + 1]
            other = even // 2
            if odd // 2 != other:
                return None
            sign = -1.0 if even % 2 else 1.0
            one, two = self.bodies[rod], self.bodies[other]
            same = self.robot.rods[other]
            shifted = abs(one.com - sign * two.com) <= self.tolerance * own.length_m / 2
            if not (shifted and self._equal((own.length_m, same.length_m), (own.cap_radius_m, same.cap_radius_m),
                                            (one.mass, two.mass))):  # fmt: skip
                return None
            taken.append(other)
        return tuple(taken)

    def cables(self, caps: tuple[int, ...]) -> tuple[int, ...] | None:
        """Several cables may join the same two caps: each takes the place of another one."""
        taken: list[int] = []
        for own in self.robot.cables:
            there = self.by_ends.get(frozenset(caps[cap] for cap in own.caps), [])
            k = next((k for k in there if k not in taken and self._same_cable(own, self.robot.cables[k])), None)
            if k is None:
                return None
            taken.append(k)
        return tuple(taken)

    def _same_cable(self, own: Cable, other: Cable) -> bool:
        rest = (own.rest_length_m or 0.0, other.rest_length_m or 0.0)
        return own.kind == other.kind and self._equal((own.stiffness_n_per_m, other.stiffness_n_per_m), rest)

    def _equal(self, *pairs: tuple[float, float]) -> bool:
        return all(abs(a - b) <= self.tolerance * max(abs(a), abs(b)) for a, b in pairs)


def _isometries(p: np.ndarray, allowed: float) -> Iterator[tuple[int, ...]]:
    """Permutations of points (n, 3) that keep all distances to `allowed` [m], mirrored ones among them."""
    distance = np.linalg.norm(p[:, None] - p[None], axis=-1)

    def longer(begun: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
        i = len(begun)
        if i == len(p):
            yield begun
            return
        for j in range(len(p)):
            if j not in begun and (np.abs(distance[j, list(begun)] - distance[i, :i]) <= allowed).all():
                yield from longer((*begun, j))

    yield from longer(())


def _turn(p: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, float]:
    """The proper rotation that takes centred points p (n, 3) nearest to q, and the root mean square distance left."""
    u, _, vt = np.linalg.svd(p.T @ q)
    sign = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    R = (u @ sign @ vt).T
    return R, float(np.sqrt(((p @ R.T - q) ** 2).sum(axis=1).mean()))
