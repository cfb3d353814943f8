"""Studies: pieces are kept, found again, gathered and compared; what is wrong is said."""

from dataclasses import replace

import numpy as np
import pytest

from indicial.conventions import ReferenceQuantities
from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import DivergenceError, InputError
from indicial.files import write_text
from indicial.motion import FlightCondition
from indicial.pipeline.progress import LogReporter
from indicial.studies import find_study
from indicial.studies.claim import Claim, largest, relative_rms
from indicial.studies.computing import AGREEMENT, compute, drift, matching
from indicial.studies.kept import Results, keep
from indicial.studies.piece import Piece, PieceResult, file_path, read_result, write_result
from indicial.studies.study import Study

MACHS = (1.5, 2.0, 3.0)
CALLS: list[str] = []


def made(piece: Piece, factor: float = 1.0) -> PieceResult:
    condition, reference = FlightCondition(piece.mach), ReferenceQuantities(0.03, 7e-4, (0.165, 0.0, 0.0))
    table = DerivativeTable(
        tuple(
            Derivative.at(condition, reference, name, "operator", value * factor, "made up", k=k)
            for name, value in (("Cm_q", -300.0 / piece.mach), ("CN_alpha", 10.0))
            for k in (None, 0.025)
        )
    )
    return PieceResult(piece, table, {"cells": 100, "cpu_s": 1.0})


def pretend(piece: Piece, folder, progress) -> PieceResult:
    CALLS.append(piece.name)
    if piece.mach == 3.0 and piece.level == "coarse":
        raise DivergenceError("it went wrong")
    return made(piece)


PIECES = tuple(
    Piece("operator", "base", level, mach, {"k": [0.025]}) for level in ("quick", "coarse") for mach in MACHS
)
STUDY = Study("toy", "Toy", PIECES, pretend, lambda results: (), lambda results, folder: (), {"one": (PIECES[0].name,)})


def test_a_result_is_the_same_after_writing_and_reading(tmp_path):
    result = made(PIECES[0])
    write_result(result, tmp_path)
    assert read_result(PIECES[0], tmp_path) == result


def test_a_result_of_other_inputs_is_not_taken(tmp_path):
    write_result(made(PIECES[0]), tmp_path)
    assert read_result(replace(PIECES[0], settings={"k": [0.05]}), tmp_path) is None


def test_what_is_there_is_not_computed_again_and_a_failure_does_not_stop_the_others(tmp_path):
    CALLS.clear()
    failed = compute(STUDY, PIECES, tmp_path, 1, LogReporter())
    assert list(failed) == ["operator-base-coarse-M3.000"]
    assert [piece.name for piece in PIECES] == CALLS
    CALLS.clear()
    compute(STUDY, PIECES, tmp_path, 1, LogReporter())
    assert CALLS == ["operator-base-coarse-M3.000"]


def test_patterns_pick_pieces_and_one_that_picks_none_is_refused():
    assert [p.name for p in matching(STUDY, "*-quick-M2*,*coarse-M1.5*")] == [PIECES[1].name, PIECES[3].name]
    with pytest.raises(InputError, match="no piece"):
        matching(STUDY, "fom*")


def test_kept_groups_grow_and_replace_and_come_back_as_they_were(tmp_path):
    keep(Results((made(PIECES[1]), made(PIECES[0]))), tmp_path)
    paths = keep(Results((made(PIECES[0], 2.0), made(PIECES[2]))), tmp_path)
    assert [path.name for path in paths] == ["operator-base-quick.json"]
    from indicial.studies.kept import _read_group

    assert _read_group(paths[0]) == [made(PIECES[0], 2.0), made(PIECES[1]), made(PIECES[2])]


def test_files_of_a_result_are_kept_beside_the_numbers_and_replaced_with_them(tmp_path):
    from indicial.studies.kept import _read_group

    work, kept = tmp_path / "work", tmp_path / "kept"
    for text in ("before", "after"):
        source = file_path(PIECES[0], work, "alpha.txt")
        write_text(source, text)
        write_result(replace(made(PIECES[0]), files={"alpha": source}), work)
        found = read_result(PIECES[0], work)
        assert found is not None
        (path,) = keep(Results((found,)), kept)
        assert _read_group(path)[0].file("alpha").read_text() == text
    assert len(list(kept.iterdir())) == 2
    with pytest.raises(InputError, match="there are alpha"):
        found.file("q")
    source.unlink()
    with pytest.raises(InputError, match="there are none"):
        keep(Results((found,)), kept)


def test_a_broken_kept_file_is_named(tmp_path):
    path = tmp_path / "operator-base-quick.json"
    path.write_text("{")
    with pytest.raises(InputError, match=r"operator-base-quick\.json"):
        keep(Results((made(PIECES[0]),)), tmp_path)


def test_series_run_over_mach_numbers_and_are_picked_by_frequency():
    results = Results(tuple(made(piece) for piece in PIECES[2::-1]))
    mach, value = results.series("Cm_q", k=None)
    np.testing.assert_allclose(mach, MACHS)
    np.testing.assert_allclose(value, -300.0 / np.array(MACHS))
    with pytest.raises(InputError, match="2 records"):
        results.series("Cm_q")


def test_drift_is_the_largest_relative_difference_and_missing_pieces_are_refused():
    kept = Results((made(PIECES[0]),))
    assert drift(kept, made(PIECES[0])).agrees
    assert drift(kept, made(PIECES[0], 1.0 + 0.5 * AGREEMENT)).agrees
    worse = drift(kept, made(PIECES[0], 1.0 - 2.0 * AGREEMENT))
    assert not worse.agrees
    assert worse.difference == pytest.approx(2.0 * AGREEMENT)
    with pytest.raises(InputError, match="not among the kept"):
        drift(kept, made(PIECES[1]))


def test_claims_name_their_worst_point_and_hold_only_if_all_is_computed():
    claim = relative_rms("x", 0.05, (2.0, 3.0), np.array([1.03, 0.94]), np.ones(2))
    assert claim.value == pytest.approx(np.sqrt((0.03**2 + 0.06**2) / 2.0))
    assert claim.holds
    assert "-6.0% at M 3" in claim.summary()
    assert not replace(claim, complete=False).holds
    assert largest("y", 0.01, (2.0,), np.array([-0.02])).verdict == "FALLS SHORT"
    assert relative_rms("z", 0.05, (), np.zeros(0), np.zeros(0)).verdict == "NOT COMPUTED"
    assert Claim("w", 0.5, None).holds


def test_an_unknown_study_is_refused_with_those_that_there_are():
    with pytest.raises(InputError, match="finner"):
        find_study("bogus")
