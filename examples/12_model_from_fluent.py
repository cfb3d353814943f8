"""From report files of Fluent to derivatives, a model and plots: what `indicial rom build` does, in Python.

The files hold the exact supersonic flat plate at Mach 2, so that every number has a right answer.
"""

import math
from pathlib import Path

from indicial.readers import read_histories
from indicial.rom import build_model
from indicial.studies.plate.exact import incidence_derivatives, steady_response

# Mach number, units, axes, columns and motions are in the map; nothing of it is assumed.
readings = read_histories(Path(__file__).parent / "fluent_plate" / "map.toml")
for reading in readings:
    print(reading.summary())
assert not any(reading.warnings for reading in readings)

# The model is made from the two steps, and predicts the oscillation.
built = build_model([reading.history for reading in readings])
print(built.summary())
built.write("from_fluent")
assert built.checks[0].worst_peak < 0.02

# Exact values about the leading edge; rates per c/2V are twice those per c/V.
cl_a, cm_a, cl_q, cm_q = steady_response(2.0)
exact = {"CN_alpha": cl_a, "Cm_alpha": cm_a, "CN_q": 2.0 * cl_q, "Cm_q": 2.0 * cm_q}
exact |= dict(zip(("CN_alphadot", "Cm_alphadot"), (2.0 * d for d in incidence_derivatives(2.0)), strict=True))
for name, value in exact.items():
    assert math.isclose(built.derivatives.value(name), value, rel_tol=0.01), name
