"""Sequences with known truth from a plan: `Plan`, `random_plan`, `office_plan`, `simulate`, `simulate_scans`.

Everything is loaded when it is asked for: importing this package costs nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from recon.simulate.office import office_plan
    from recon.simulate.plan import Plan
    from recon.simulate.random_building import random_plan
    from recon.simulate.simulation import Simulation, run_simulation, simulate_scans
    from recon.simulate.write import simulate, simulate_file

__all__ = [
    "Plan",
    "Simulation",
    "office_plan",
    "random_plan",
    "run_simulation",
    "simulate",
    "simulate_file",
    "simulate_scans",
]

_HOMES = {
    "Plan": "plan",
    "office_plan": "office",
    "Simulation": "simulation",
    "random_plan": "random_building",
    "run_simulation": "simulation",
    "simulate": "write",
    "simulate_file": "write",
    "simulate_scans": "simulation",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
