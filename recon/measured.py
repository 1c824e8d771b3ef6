"""What people measured in the building: distances between walls, and points with surveyed coordinates."""

from __future__ import annotations

from dataclasses import dataclass

from recon.config import GraphConfig
from recon.control import ControlPoints, contradictions, control_on_layout
from recon.errors import ConfigError
from recon.geometry import Array
from recon.graph.control import Control
from recon.graph.estimate import MapEstimate
from recon.graph.tape import Tape
from recon.model import Layout
from recon.tape import TapeMeasures, surprises, tape_on_layout


@dataclass(frozen=True)
class Measured:
    """Distances and points, by the names that people know; None where there are none."""

    tape: TapeMeasures | None = None
    control: ControlPoints | None = None

    def __bool__(self) -> bool:
        return self.tape is not None or self.control is not None

    def check_backend(self, config: GraphConfig) -> None:
        """Raises ConfigError where the backend takes neither."""
        if self and config.backend != "graph":
            files = ([] if self.tape is None else [self.tape.path]) + list(self.control.files if self.control else ())
            raise ConfigError(f"{files[0]}: the filter takes no distances or points, expected graph.backend 'graph'")

    def on_layout(self, layout: Layout, timestamps: Array) -> tuple[Tape | None, Control | None]:
        """As factors, in the map of a layout that was made without them from scans at timestamps (N,) s.

        Raises InputError for walls that are not there, or not seen, and for times without scans.
        """
        tape = None if self.tape is None else tape_on_layout(self.tape, layout)
        return tape, None if self.control is None else control_on_layout(self.control, timestamps, layout)

    def surprises(self, estimate: MapEstimate) -> list[str]:
        """A line for every distance or point that contradicts the solution."""
        lines = [] if self.tape is None else surprises(self.tape, estimate.tape)
        if self.control is not None and estimate.survey is not None:
            lines += contradictions(self.control, estimate.survey)
        return lines


NOTHING = Measured()
