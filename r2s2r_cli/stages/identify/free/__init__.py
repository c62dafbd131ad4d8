"""Which numbers can be free in a fit, how people name them, and how their values become what the engine reads."""

from r2s2r_cli.stages.identify.free.base import (
    Coordinate as Coordinate,
    Free as Free,
    slopes_of as slopes_of,
    values_of as values_of,
)
from r2s2r_cli.stages.identify.free.catalogue import catalogue as catalogue
from r2s2r_cli.stages.identify.free.mapping import Mapping as Mapping, Observation as Observation
from r2s2r_cli.stages.identify.free.select import select as select
from r2s2r_cli.stages.identify.free.write import with_values as with_values
