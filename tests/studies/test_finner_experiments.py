"""The Finner's experiments: parts add up to the whole, and a variant differs in what it says and in nothing else."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import finned_body_mesh
from indicial.errors import InputError
from indicial.methods import operator
from indicial.motion import FlightCondition
from indicial.studies.finner.by_part import derivatives_by_part
from indicial.studies.finner.experiments import EXPERIMENTS
from indicial.studies.finner.pieces import PIECES
from indicial.studies.finner.variants import FINNER, VARIANTS, body_of

CONDITION = FlightCondition(2.0)


@cache
def solver() -> FiniteVolumeSolver:
    return FiniteVolumeSolver(finned_body_mesh(FINNER, 0.45, mach=2.0), FINNER.reference(5.5))


def test_loads_of_the_wall_faces_add_up_to_those_of_the_operator() -> None:
    flow = solver().linearise(CONDITION)[0]
    x = np.random.default_rng(1).normal(size=flow.size)
    for motion in (None, "alpha", "q"):
        direct = 0.0 if motion is None else flow.d[:, flow.inputs.index(motion)]
        wanted = flow.c @ x + direct
        assert flow.wall_loads(x, motion).sum(axis=1) == pytest.approx(wanted, rel=1e-10, abs=1e-10)


def test_parts_add_up_to_the_derivatives_of_the_whole() -> None:
    parts = derivatives_by_part(solver(), CONDITION, FINNER)
    whole = operator.derivatives(operator.run(solver(), CONDITION))
    for name in ("CN_alpha", "CN_alphadot", "Cm_q", "Cm_alphadot"):
        total = sum(part[name] for part in parts.values())
        assert total == pytest.approx(whole.value(name, k=None), rel=1e-5, abs=1e-4 * abs(whole.value("Cm_q", k=None)))


def test_a_supersonic_body_ahead_of_the_fins_does_not_know_of_them() -> None:
    """At M 2 nothing travels upstream: its loads are those of the body without fins, on the same stations."""
    part = derivatives_by_part(solver(), CONDITION, FINNER)["body ahead of the fins"]
    thin = replace(FINNER, fins=replace(FINNER.fins, thickness_ratio=0.04))
    other = FiniteVolumeSolver(finned_body_mesh(thin, 0.45, mach=2.0), FINNER.reference(5.5))
    again = derivatives_by_part(other, CONDITION, thin)["body ahead of the fins"]
    assert part["CN_alpha"] == pytest.approx(again["CN_alpha"], rel=2e-2)


def test_variants_change_what_they_say() -> None:
    assert body_of("sting") == FINNER == body_of("base")
    assert body_of("sting+no_fins").fins is None
    for name, changes in VARIANTS.items():
        body = body_of(f"base+{name}")
        if body.fins is not None:
            assert {field: getattr(body.fins, field) for field in changes} == changes
            assert body.fins.trailing_edge == FINNER.fins.trailing_edge
    with pytest.raises(InputError, match="variant"):
        body_of("base+round_fins")


def test_experiments_have_names_of_their_own() -> None:
    names = [piece.name for piece in (*PIECES, *EXPERIMENTS)]
    assert len(set(names)) == len(names)
