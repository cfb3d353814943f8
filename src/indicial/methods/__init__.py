"""The methods that read dynamic derivatives: each is a choice of motion and a way of reading the loads.

- `moving_frame` (MRF): steady solutions at constant rate;
- `forced_oscillation` (FOM): harmonic motion and its three reductions;
- `indicial_response` (IRM): steps, and the area under their deficiency.

Each keeps its experiments apart from their reading, and its `run` takes any `indicial.solver.Solver`.
"""

from indicial.methods import forced_oscillation, indicial_response, moving_frame

__all__ = ["forced_oscillation", "indicial_response", "moving_frame"]
