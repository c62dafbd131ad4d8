"""The differentiable tensegrity engine: tensors in, tensors out. Knows no project, no file and no command line."""

from r2s2r_cli.engine.balance import Balance as Balance, balance as balance
from r2s2r_cli.engine.closed_loop import ClosedLoopRun as ClosedLoopRun, closed_loop as closed_loop
from r2s2r_cli.engine.errors import (
    EngineError as EngineError,
    EngineInputError as EngineInputError,
    NonFiniteError as NonFiniteError,
)
from r2s2r_cli.engine.flat import (
    flat_step as flat_step,
    pack_parameters as pack_parameters,
    pack_state as pack_state,
    unpack_parameters as unpack_parameters,
    unpack_state as unpack_state,
)
from r2s2r_cli.engine.ground import Ground as Ground, tilted as tilted
from r2s2r_cli.engine.hooks import Channel as Channel, Hooks as Hooks
from r2s2r_cli.engine.late import delay_of as delay_of, observe as observe, sense as sense, unseen as unseen
from r2s2r_cli.engine.link import Link as Link
from r2s2r_cli.engine.parameters import Parameters as Parameters, check_parameters as check_parameters
from r2s2r_cli.engine.pid import LatchedPid as LatchedPid
from r2s2r_cli.engine.reading import (
    Reading as Reading,
    cap_lengths as cap_lengths,
    energy as energy,
    longest_step as longest_step,
    momentum as momentum,
    read as read,
)
from r2s2r_cli.engine.rollout import Simulator as Simulator
from r2s2r_cli.engine.settle import Settled as Settled, settled as settled, window_state as window_state
from r2s2r_cli.engine.state import (
    State as State,
    angular_velocities as angular_velocities,
    cap_velocities as cap_velocities,
    check_state as check_state,
    end_caps as end_caps,
    middles as middles,
    pose_state as pose_state,
)
from r2s2r_cli.engine.step import step as step
from r2s2r_cli.engine.structure import Detach as Detach, Structure as Structure
from r2s2r_cli.engine.trajectory import Trajectory as Trajectory
