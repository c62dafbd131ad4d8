"""Native speed: any torch step function, traced to a scalar program and compiled with llvmlite.

Nothing here knows what the step computes. `symbolic` records, `nodes` and `graph` hold the program, `reverse` and
`tangent` differentiate it, `emit` and `kernels` write it as LLVM text, `machine` and `cache` make it run,
`run_forward`, `run_backward` and `run_tangent` call it, `step` is the face.
"""

from r2s2r_cli.engine.native.build import Build as Build
from r2s2r_cli.engine.native.eager import NativeFallbackWarning as NativeFallbackWarning
from r2s2r_cli.engine.native.rollout import rollout as rollout
from r2s2r_cli.engine.native.step import NativeStep as NativeStep
from r2s2r_cli.engine.native.symbolic import StepFn as StepFn, TracingError as TracingError
