"""The Basic Finner over its whole Mach range: derivatives by every method, against free-flight range data."""

from indicial.studies.finner.agreement import claims
from indicial.studies.finner.computing import compute
from indicial.studies.finner.experiments import EXPERIMENTS
from indicial.studies.finner.figures import draw
from indicial.studies.finner.pieces import PIECES
from indicial.studies.study import Study

STUDY = Study(
    name="finner",
    title="Basic Finner, M 1.05 to 4.5, against free flight",
    pieces=(*PIECES, *EXPERIMENTS),
    compute=compute,
    claims=claims,
    draw=draw,
    subsets={"coarse": ("operator-base-quick-M2.375", "operator-base-quick-M3.734")},
)

__all__ = ["STUDY"]
