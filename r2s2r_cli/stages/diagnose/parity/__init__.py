"""Stage 0 of a diagnosis: what the logs say against each other and against robot.toml, without a simulator."""

from r2s2r_cli.stages.diagnose.parity.finding import (
    Element as Element,
    Finding as Finding,
    Mismatch as Mismatch,
    Parity as Parity,
    Suspicion as Suspicion,
)
from r2s2r_cli.stages.diagnose.parity.parity import parity as parity
