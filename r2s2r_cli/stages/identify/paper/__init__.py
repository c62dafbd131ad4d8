"""The paper's identification by name: Key Frame Loss, its rivals, the direction mask, Adam."""

from r2s2r_cli.stages.identify.paper.adam import (
    PaperFit as PaperFit,
    Settings as Settings,
    Trace as Trace,
    identify_paper as identify_paper,
    simulated as simulated,
)
from r2s2r_cli.stages.identify.paper.demonstration import (
    Demonstration as Demonstration,
    demonstrations as demonstrations,
    synthetic as synthetic,
)
from r2s2r_cli.stages.identify.paper.flight import (
    Flight as Flight,
    World as World,
    fly as fly,
    fly_side_by_side as fly_side_by_side,
    replay as replay,
)
from r2s2r_cli.stages.identify.paper.key_frames import (
    KeyFrames as KeyFrames,
    Spans as Spans,
    key_frames as key_frames,
    spans as spans,
)
from r2s2r_cli.stages.identify.paper.losses import (
    Loss as Loss,
    LossValue as LossValue,
    Norm as Norm,
    Window as Window,
)
from r2s2r_cli.stages.identify.paper.mask import Mask as Mask, direction_mask as direction_mask
from r2s2r_cli.stages.identify.paper.preset import (
    PAPER_FREE as PAPER_FREE,
    Preset as Preset,
    preset as preset,
    settled_start as settled_start,
)
from r2s2r_cli.stages.identify.paper.shooting import (
    Compared as Compared,
    compare as compare,
    paired as paired,
    seen as seen,
)
