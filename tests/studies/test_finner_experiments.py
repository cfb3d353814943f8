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
from indicial.studies import find_study
from indicial.studies.finner.across_fins import AcrossFins
from indicial.studies.finner.by_part import derivatives_by_part
from indicial.studies.finner.experiment_claims import peak
from indicial.studies.finner.experiment_figures import THICKNESSES, jump
from indicial.studies.finner.experiments import EXPERIMENTS
from indicial.studies.finner.pieces import PIECES
from indicial.studies.finner.variants import FINNER, VARIANTS, body_of
from indicial.studies.finner.wedge import sonic_mach
from indicial.studies.kept import Results

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


def test_the_flow_across_the_fins_is_on_one_cylinder_and_survives_a_file(tmp_path) -> None:
    flow = AcrossFins.of(solver(), CONDITION)
    radius = np.hypot(flow.surface.points[:, 1], flow.surface.points[:, 2])
    assert np.ptp(radius) < 0.02
    assert set(flow.surface.values) == {"mach", "lag"}
    flow.save(tmp_path / "surface.npz")
    again = AcrossFins.load(tmp_path / "surface.npz")
    assert again.mach == flow.mach
    for name, values in flow.surface.values.items():
        assert again.surface.values[name] == pytest.approx(values, rel=1e-6, abs=1e-5)
    (tmp_path / "other.npz").write_bytes(b"no archive")
    with pytest.raises(InputError, match="not a flow across fins"):
        AcrossFins.load(tmp_path / "other.npz")


def test_the_peak_of_a_parabola_is_found_between_its_points() -> None:
    mach = np.array([1.0, 1.1, 1.2, 1.3, 1.4])
    assert peak(mach, 5.0 - (mach - 1.234) ** 2) == pytest.approx(1.234)
    assert peak(mach, mach) == 1.4


def test_thicker_fins_have_their_jump_at_higher_mach_numbers_above_that_of_a_sonic_wedge() -> None:
    """Kept results."""
    kept = Results.kept("finner", find_study("finner").pieces)
    wedges = {kind: thickness for kind, (thickness, _) in THICKNESSES.items() if thickness}
    peaks = [peak(*jump(kept, kind)) for kind in wedges]
    assert peaks == sorted(peaks)
    for mach, thickness in zip(peaks, wedges.values(), strict=True):
        assert 0.0 < mach - sonic_mach(np.arctan(0.5 * thickness)) < 0.05
