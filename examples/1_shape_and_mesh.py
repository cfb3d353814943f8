"""A missile from numbers to a checked mesh."""

from indicial.cfd.mesh import finned_body_mesh
from indicial.cfd.shapes import FinnedBody, FinSet, Nose

fins = FinSet(number=4, root_chord=1.0, tip_chord=1.0, span=1.0, trailing_edge=10.0, thickness_ratio=0.08)
body = FinnedBody(diameter=0.030, nose=Nose("cone", 2.836), length=10.0, fins=fins)
print(body.summary())

mesh = finned_body_mesh(body, "quick", mach=2.0)
report = mesh.check()
print(report.summary())

assert report.closure < 1e-12
assert {"body", "fin1", "farfield", "outflow", "symmetry"} <= set(report.patches)
