"""The range study: its kept results are complete and its figures hold, and the yaw it flies is the yaw it asks for."""

import math
from pathlib import Path

import numpy as np
import pytest

from indicial.reference_data import read_table
from indicial.studies.kept import Results
from indicial.studies.range import STUDY
from indicial.studies.range.agreement import DAMPING, closing_arrays, implied_noise
from indicial.studies.range.computing import damping_error, group_flights, published, shot
from indicial.studies.range.pieces import LEAST_YAW, PIECES, groups

KEPT = Results.kept("range", STUDY.pieces)


def test_every_piece_is_kept_and_every_asked_figure_holds() -> None:
    assert len(KEPT) == len(STUDY.pieces)
    for claim in STUDY.claims(KEPT):
        assert claim.holds, claim.summary()


def test_groups_have_the_mach_number_and_the_yaw_that_the_report_prints() -> None:
    """Means over the shots, so that the two shots left out are those the report left out."""
    table = read_table("basic_finner_range_multifit")
    printed = dict(zip(table.numbers("mach"), table.numbers("dbsq_mean_deg2"), strict=True))
    for mach, shots in groups().items():
        assert np.mean([m for m, _ in shots]) == pytest.approx(mach, abs=2e-3)
        assert np.mean([yaw for _, yaw in shots]) == pytest.approx(printed[mach], abs=0.3)


def test_shots_have_the_yaw_asked_for() -> None:
    piece = next(piece for piece in PIECES if piece.method == "closing")
    truth = {name: value for name, (value, _) in published(piece.mach).items()}
    flown = shot(truth, 1.06, 2.0, 0.7, piece.settings)
    assert np.mean(np.degrees(flown.total_angle) ** 2) == pytest.approx(2.0, rel=0.02)
    assert flown.rate[0, 0] == pytest.approx(50.0)


def test_records_of_different_groups_share_no_noise() -> None:
    """Normalised errors of two groups would be alike if they did."""
    errors, reported = closing_arrays(list(KEPT.select(method="closing")))
    scaled = (errors / reported).reshape(len(errors), -1)
    correlation = np.corrcoef(scaled) - np.eye(len(scaled))
    assert np.max(np.abs(correlation)) < 4.5 / math.sqrt(scaled.shape[1])


def test_implied_noise_gives_the_printed_error() -> None:
    """Flown and reduced again at the noise kept, a group has the error that the report prints."""
    result = next(iter(KEPT.select(method="implied")))
    settings, noise = result.piece.settings, implied_noise(result)
    assert set(noise) == set(groups())
    for mach in (1.293, 3.734):
        truth = {name: value for name, (value, _) in published(mach).items()}
        flights = group_flights(truth, groups()[mach], settings)
        found = damping_error(flights, truth, settings["stations"], {**settings, "angle_deg": noise[mach]})
        assert found == pytest.approx(published(mach)["Cm_q+Cm_alphadot"][1], rel=2e-3), mach


def test_the_error_is_in_proportion_to_all_noise_together_and_not_to_that_of_angles_alone() -> None:
    settings = next(piece for piece in PIECES if piece.method == "implied").settings
    truth = {name: value for name, (value, _) in published(2.375).items()}
    flights = [shot(truth, 2.375, 1.0, 0.0, settings)]
    once = damping_error(flights, truth, 54, settings)
    thrice = {**settings, **{name: 3.0 * settings[name] for name in ("position_mm", "angle_deg", "roll_deg")}}
    assert damping_error(flights, truth, 54, thrice) == pytest.approx(3.0 * once, rel=0.01)
    assert damping_error(flights, truth, 54, {**settings, "angle_deg": 0.3}) < 2.7 * once


def test_errors_fall_with_yaw_and_stations_as_they_must() -> None:
    rows = next(iter(KEPT.select(method="implied"))).provenance["rows"]
    table = {(r["yaw_deg"], r["stations"], r["angle_deg"]): r["pe_pct"] for r in rows}
    assert table[0.5, 54, 0.1] / table[1.0, 54, 0.1] == pytest.approx(2.0, rel=0.1)
    assert table[1.0, 20, 0.1] / table[1.0, 100, 0.1] == pytest.approx(math.sqrt(5.0), rel=0.1)


def test_a_group_is_recovered_again_as_it_was_kept() -> None:
    name = STUDY.subsets["coarse"][0]
    piece = next(piece for piece in PIECES if piece.name == name)
    again = STUDY.compute(piece, None, None)  # type: ignore[arg-type]
    kept = KEPT.select(method="closing").at(piece.mach)
    assert kept is not None
    np.testing.assert_allclose(again.provenance["errors"], kept.provenance["errors"], rtol=1e-4, atol=1e-6)


def test_the_page_says_what_is_kept() -> None:
    """The table of three reductions at M 2.718, and how errors reported compare with the scatter."""
    page = (Path(__file__).resolve().parents[2] / "docs" / "studies" / "range.md").read_text(encoding="utf-8")
    group = next(r for r in KEPT.select(method="closing") if r.piece.mach == 2.718)
    told: dict[str, list[str]] = {}
    for row in group.provenance["columns"]:
        told.setdefault(row["shot"], []).append(f"{row[DAMPING]:.0f} ({row[f'{DAMPING}_pe_pct']:.2g}%)")
    for shot_name, (mach, yaw) in zip(("shot 1", "shot 2", "shot 3"), groups()[2.718], strict=True):
        shown = 0.0 if yaw == LEAST_YAW else yaw
        assert f"| M {mach:g} | {shown:.1f} | {' | '.join(told[shot_name])} | |" in page
    assert f"| all | | | | {told['all'][0]} |" in page
    errors, reported = closing_arrays(list(KEPT.select(method="closing")))
    ratio = 1.0 / np.sqrt(np.mean((errors / reported) ** 2, axis=(0, 1)))
    assert f"| {ratio.min():.2f} to {ratio.max():.2f} | 0.85 to 1.15 |" in page
