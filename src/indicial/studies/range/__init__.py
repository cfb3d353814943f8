"""The ballistic range, closed: shots with the published coefficients flown, measured and reduced as it did."""

from indicial.studies.range.agreement import claims
from indicial.studies.range.computing import compute
from indicial.studies.range.figures import draw
from indicial.studies.range.pieces import PIECES
from indicial.studies.study import Study

STUDY = Study(
    name="range",
    title="The Basic Finner in the range: simulated, measured, reduced",
    pieces=PIECES,
    compute=compute,
    claims=claims,
    draw=draw,
    subsets={"coarse": ("closing-range-sixdof-M2.718",)},
)

__all__ = ["STUDY"]
