"""Effects between the shaft and the cable: spool, play, and where the cable is tied."""

from __future__ import annotations

from typing import Literal

import numpy as np

from r2s2r_cli.rig.effects.base import EffectSection, Law, Scene, per
from r2s2r_cli.rig.section import Index, NonNegative, Positive, Section, Share, Shift3, Size


class SpoolBuildup(EffectSection):
    """Cable winds over cable: after every `wraps` turns the spool is thicker by one layer."""

    layer_m: Size = 0.0005
    """Thickness of a layer [m]."""
    wraps: Positive = 2.0
    """Turns a layer."""
    start_turns: NonNegative = 0.0
    """Turns that lie on the spool in the rest pose."""

    def law(self, scene: Scene) -> Law:
        """Steps from layer to layer, smoothed over a fifth of a turn; the catalogue has a line in the angle."""
        return _Layers(self)


class _Layers(Law):
    def __init__(self, p: SpoolBuildup) -> None:
        self._p = p

    def radius(self, angle: np.ndarray, r: np.ndarray) -> np.ndarray:
        layers = np.maximum(self._p.start_turns + angle / (2 * np.pi), 0.0) / self._p.wraps
        whole = np.floor(layers)
        width = 0.2 / self._p.wraps
        rise = np.clip((layers - whole - (1 - width)) / width, 0.0, 1.0)
        return r + self._p.layer_m * (whole + rise)


class Backlash(EffectSection):
    """Play of the gears: after a reversal the winch turns without effect until the play is used up."""

    play_m: Size | tuple[Size, ...] = 0.005
    """Length of cable that a reversal loses [m]; one, or one a winched cable."""
    soft_share: Share = 0.3
    """Part of the play in which the winch takes hold little by little."""

    def law(self, scene: Scene) -> Law:
        """A play operator with a soft end, where the catalogue's is hard."""
        n = len(scene.r)
        play = per(self.play_m, n, 0.0) if isinstance(self.play_m, tuple) else np.full(n, float(self.play_m))
        return _Play(play, self.soft_share)


class _Play(Law):
    def __init__(self, play: np.ndarray, soft: float) -> None:
        self._half, self._soft = play / 2, soft
        self._out: np.ndarray | None = None
        self._before: np.ndarray | None = None

    def rest(self, dt: float, rest: np.ndarray, tension: np.ndarray) -> np.ndarray:
        if self._out is None or self._before is None:
            # The cable was let out last: it is in play against being reeled in.
            self._out, self._before = rest - self._half, rest.copy()
        gap = rest - self._out
        step = rest - self._before
        self._before = rest.copy()
        # How far into the soft end the winch stands, on the side to which it turns: 0 free, 1 firm.
        end = np.maximum(self._half * self._soft, 1e-12)
        hold = np.clip((gap * np.sign(step) - (self._half - end)) / end, 0.0, 1.0)
        moved = self._out + hold * step
        self._out = np.clip(moved, rest - self._half, rest + self._half)
        return self._out + self._half


class Moved(Section):
    """An end of a cable that is tied elsewhere."""

    cable: Index
    """Its number."""
    end: Literal[0, 1] = 0
    """0 or 1: which of its two caps."""
    by_m: Shift3
    """In the rod's frame R [m]."""


class AttachmentOffset(EffectSection):
    """Cables are not tied where `robot.toml` says."""

    moved: tuple[Moved, ...]
    """The ends that are tied elsewhere."""

    def law(self, scene: Scene) -> Law:
        """Sites of the MuJoCo model moved, each by itself, where the catalogue moves all that is tied to a cap."""
        for one in self.moved:
            cap = scene.robot.cables[one.cable].caps[one.end]
            site = scene.sim.model.site(f"cable{one.cable}_cap{cap}").id
            scene.sim.model.site_pos[site] += np.array(one.by_m)
        return Law()
