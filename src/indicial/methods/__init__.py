"""The methods that read dynamic derivatives: each is a choice of motion and a way of reading the loads.

- `moving_frame` (MRF): steady solutions at constant rate;
- `forced_oscillation` (FOM): harmonic motion and its three reductions;
- `operator`: the linearised flow, all derivatives from a few linear solves, at k = 0 and at any k;
- `adjoint`: the same by transposed solves, one for each load;
- `indicial_response` (IRM): steps, and the area under their deficiency;
- `reduced_frequency`: harmonic motion solved as a periodic flow, a few harmonics at a time.

Each keeps its experiments apart from their reading, and its `run` takes any solver of the protocol in
`indicial.solver` that it names.
"""

from indicial.methods import adjoint, forced_oscillation, indicial_response, moving_frame, operator, reduced_frequency

__all__ = ["adjoint", "forced_oscillation", "indicial_response", "moving_frame", "operator", "reduced_frequency"]
