"""Windows through the engine: end caps at the observed frames, and their exact derivatives by parameters and starts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from r2s2r_cli.errors import NumericalError, UsageError
from r2s2r_cli.stages.identify.commands import CommandLog
from r2s2r_cli.stages.identify.offsets import count, displaced, displacement_jacobian
from r2s2r_cli.stages.identify.prediction import Prediction, alike, joined
from r2s2r_cli.stages.identify.view import caps_by_parameters, caps_by_state, caps_in_view
from r2s2r_cli.stages.identify.windows import Window

if TYPE_CHECKING:
    from torch import Tensor

    from r2s2r_cli.engine import Parameters
    from r2s2r_cli.stages.identify.free import Free, Mapping
    from r2s2r_cli.stages.identify.free.mapping import Observation
    from r2s2r_cli.stages.identify.ways import Way

STRIDE = 5
"""Engine steps between two stored states. Between them caps are interpolated: at 1 ms an acceleration of 10 m/s^2 bends
the path by 0.03 mm."""


@dataclass(frozen=True)
class _Numbers:
    """Parameters at values (n,): batch of 1; flat (NP,); by_value: derivatives of the flat ones, (NP, n), None where no
    derivatives are asked for."""

    theta: Parameters
    flat: Tensor
    by_value: Tensor | None
    seen: Observation


class Predictor:
    """Simulates windows by command replay. Holds the compiled step: keep it for a whole fit.

    step: of the engine [s]. cache_dir: of the machine code. rollouts counts simulated windows. ways: start states that
    were found with it, by run (`start_states`). Raises UsageError for a free number that a start state would have to
    follow.
    """

    def __init__(
        self, mapping: Mapping, *, step: float = 1e-3, cache_dir: Path | None = None, threads: int = 2
    ) -> None:
        from r2s2r_cli.engine.rollout import Simulator

        moving = [name for name in mapping.names if name.startswith("com.")]
        if moving:
            # Start states are places of the centres of mass: these would have to move along.
            raise UsageError(
                f"{moving[0]} cannot be free in command replay", where="--free", expected="it given, not fitted",
                received=", ".join(moving), hint=f"r2s2r identify --fix {moving[0]}=0.005",
            )  # fmt: skip
        self.mapping = mapping
        self.structure = mapping.structure
        self.cable_caps = tuple((a, b) for a, b in (cable.caps for cable in mapping.robot.cables))
        self.step = step
        self.simulator = Simulator(self.structure, cache_dir=cache_dir, threads=threads)
        self.rollouts = 0
        self.ways: dict[str, Way] = {}

    def starting(self, frees: Sequence[Free]) -> Predictor:
        """The same, with its machine code and its count of rollouts, for other starts and priors of its numbers."""
        other = copy(self)
        other.mapping = self.mapping.starting(frees)
        return other

    @property
    def native(self) -> bool:
        """Whether machine code does the steps."""
        import torch

        return bool(self.simulator.kernels.native(torch.zeros(1, dtype=torch.float64)))

    def predict(
        self,
        windows: Sequence[Window],
        values: np.ndarray,
        offsets: np.ndarray | None = None,
        *,
        jacobian: bool = False,
    ) -> Prediction:
        """End caps of windows at parameter values (n,), start states moved by offsets (W, offset); None: not moved, and
        no derivatives by them. Raises NumericalError where the simulation leaves the finite numbers, InputError for
        values that are no robot.
        """
        at = self._numbers(values, jacobian)
        groups = alike(windows)
        parts = []
        for group in groups:
            own = None if offsets is None else offsets[group]
            parts.append(self._together([windows[k] for k in group], at, own))
        return joined(groups, parts, len(windows))

    def _numbers(self, values: np.ndarray, jacobian: bool) -> _Numbers:
        import torch

        from r2s2r_cli.engine.flat import pack_parameters

        x = torch.as_tensor(values, dtype=torch.float64)
        theta = self.mapping.theta(x)
        flat = pack_parameters(self.structure, theta)[0]
        return _Numbers(theta, flat, self.mapping.jacobian(x) if jacobian else None, self.mapping.observation(values))

    def _together(self, windows: Sequence[Window], at: _Numbers, offsets: np.ndarray | None) -> Prediction:
        """Windows of about the same length as one batch."""
        import torch

        from r2s2r_cli.engine import EngineError
        from r2s2r_cli.engine.flat import pack_state, unpack_state

        s0 = torch.cat([pack_state(self.structure, window.state) for window in windows])
        moved = None if offsets is None else torch.as_tensor(offsets, dtype=torch.float64)
        start = unpack_state(self.structure, s0 if moved is None else displaced(self.structure, s0, moved))
        rows = STRIDE * (math.ceil(max(window.duration for window in windows) / self.step / STRIDE) + 1)
        u, by_delay = self._commands(windows, rows, at)
        self.rollouts += len(windows)
        tangents = None
        try:
            if at.by_value is None:
                with torch.no_grad():
                    run = self.simulator.rollout(at.theta, start, u, step=self.step, every=STRIDE)
            else:
                d_p, d_u, d_s = self._directions(at.by_value, s0, moved, by_delay)
                run, tangents = self.simulator.jvp(
                    at.theta, start, u, d_parameters=d_p, d_state=d_s, d_commands=d_u, step=self.step, every=STRIDE
                )
        except EngineError as error:
            raise refused(error, windows) from error
        return self._seen(windows, at, pack_state(self.structure, run.states, leading=2), tangents, moved is not None)

    def _commands(self, windows: Sequence[Window], rows: int, at: _Numbers) -> tuple[Tensor, Tensor | None]:
        """Commands (W, row, actuated) and, where a delay is free, their derivatives by it."""
        import torch

        logs = {id(window.run): CommandLog(window.run) for window in windows}
        given = [(logs[id(window.run)], window.start) for window in windows]
        how = {"step": self.step, "delay": at.seen.command_delay + at.seen.camera_delay}
        u = torch.as_tensor(np.stack([log.means(start, rows, **how) for log, start in given]))
        if at.by_value is None or not self.mapping.delays:
            return u, None
        return u, torch.as_tensor(np.stack([log.by_delay(start, rows, **how) for log, start in given]))

    def _directions(
        self, by_value: Tensor, s0: Tensor, moved: Tensor | None, by_delay: Tensor | None
    ) -> tuple[Tensor, Tensor | None, Tensor | None]:
        """Tangents of parameters (NP, D), commands (W, row, actuated, D) and start states (W, NS, D): D are the
        parameters, then the offsets, which are those of each window's own start."""
        import torch

        n, extra = by_value.shape[1], 0 if moved is None else count(self.structure)
        d_p = torch.nn.functional.pad(by_value, (0, extra))
        d_u = None
        if by_delay is not None:
            d_u = torch.zeros(*by_delay.shape, n + extra, dtype=torch.float64)
            for k in self.mapping.delays:
                d_u[..., k] = by_delay
        d_s = None
        if moved is not None:
            d_s = torch.nn.functional.pad(displacement_jacobian(self.structure, s0, moved), (n, 0))
        return d_p, d_u, d_s

    def _seen(
        self, windows: Sequence[Window], now: _Numbers, flat: Tensor, tangents: Tensor | None, with_offsets: bool
    ) -> Prediction:
        """End caps at the frames from the stored states flat (W, stored, NS) and their tangents (W, stored, NS, D)."""
        import torch

        at = [(w.run.t[w.frames] - w.start) / (self.step * STRIDE) for w in windows]
        index = torch.as_tensor(np.concatenate([np.full(len(a), k) for k, a in enumerate(at)]))
        place = torch.as_tensor(np.concatenate(at))
        low = place.floor().long()
        share = (place - low)[:, None]
        states = flat[index, low] * (1 - share) + flat[index, low + 1] * share

        structure, p = self.structure, now.flat
        p_WE = caps_in_view(structure, p, states).numpy() + np.array([0.0, 0.0, now.seen.ground_height])
        if tangents is None or now.by_value is None:
            return Prediction(p_WE, index.numpy())
        along = tangents[index, low] * (1 - share[..., None]) + tangents[index, low + 1] * share[..., None]
        d = torch.einsum("fcis,fsd->fcid", caps_by_state(structure, p, states), along)
        n = now.by_value.shape[1]
        by_value = (d[..., :n] + caps_by_parameters(structure, p, now.by_value, states)).numpy()
        for k, name in enumerate(self.mapping.names):
            if name == "ground_height":
                by_value[:, :, 2, k] += 1.0
        return Prediction(p_WE, index.numpy(), by_value, d[..., n:].numpy() if with_offsets else None)


def refused(error: Exception, windows: Sequence[Window]) -> Exception:
    """The engine's error in our words; NumericalError where a fit may try a smaller step."""
    from r2s2r_cli.engine import EngineInputError, NonFiniteError

    runs = ", ".join(sorted({window.run.name for window in windows}))
    if isinstance(error, NonFiniteError):
        return NumericalError(
            "the simulation left the finite numbers", where=f"{runs}, {error.time:g} s after a start, {error.body}",
            expected="finite numbers", received=error.term, hint="r2s2r identify --show-config",
        )  # fmt: skip
    if isinstance(error, EngineInputError):
        return NumericalError(
            f"the fit tried a robot that cannot be: {error.what}", where=error.field, expected=error.expected,
            received=error.received, hint="narrow its bounds: --free NAME=START,LOWER..UPPER",
        )  # fmt: skip
    return error
