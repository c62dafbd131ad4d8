"""The differentiable tensegrity engine: tensors in, tensors out. Knows no project, no file and no command line."""

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
from r2s2r_cli.engine.hooks import Channel as Channel, Hooks as Hooks
from r2s2r_cli.engine.parameters import Parameters as Parameters, check_parameters as check_parameters
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
