"""Stage 1 of a diagnosis: when, in which channel, at which element and at which place the gap arises."""

from r2s2r_cli.stages.diagnose.where.found import (
    Onset as Onset,
    PlaceMap as PlaceMap,
    ProbeGain as ProbeGain,
    Reading as Reading,
    SegmentGap as SegmentGap,
    Where as Where,
)
from r2s2r_cli.stages.diagnose.where.where import where as where
