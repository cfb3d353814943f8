"""A case file is checked before a core is spent; what is wrong is one line naming file, key and what is allowed."""

import math

import pytest

from indicial.case import case_reference, parse_case, read_case
from indicial.errors import InputError
from indicial.reference_data import data_folder, find_case

QUICK = find_case("basic_finner_quick").read_text(encoding="utf-8")


def test_every_packaged_case_is_valid():
    cases = [item for item in (data_folder() / "cases").iterdir() if item.name.endswith(".toml")]
    assert cases
    for item in cases:
        parse_case(item.read_text(encoding="utf-8"), item.name)


def test_case_gives_condition_and_reference_in_si_units_and_radians():
    case = parse_case(QUICK.replace("alpha_deg = 0.0", "alpha_deg = 3.0"))
    assert case.flight_condition.alpha == pytest.approx(math.radians(3.0))
    assert case.reference_quantities.length == 0.03
    assert case.reference_quantities.area == pytest.approx(math.pi * 0.03**2 / 4)
    assert case.reference_quantities.moment_reference[0] == pytest.approx(5.5 * 0.03)


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("mach = 2.0", "mahc = 2.0", r"f\.toml: condition\.mahc: unknown key; did you mean 'mach'\? allowed: mach, "),
        ("mach = 2.0", 'mach = "2"', r"f\.toml: condition\.mach: is '2'; allowed: a number greater than 0 and at most"),
        ("mach = 2.0", "mach = nan", r"f\.toml: condition\.mach: is nan; allowed"),
        ("mach = 2.0", "mach = true", r"f\.toml: condition\.mach: is True; allowed: a number"),
        ("mach = 2.0", "mach = 1.2", r"f\.toml: condition\.mach: is too low .* allowed: at least 1\.4, or any"),
        ("resolution = 1.0", 'resolution = 1.0\nwake = "base"', r"mesh\.wake: is 'base'; allowed: 'none' or 'sting'"),
        (
            "resolution = 1.0",
            "resolution = 1.0\nradius_calibres = 40.0",
            r"mesh\.radius_calibres: says nothing with wake = 'none'; allowed: leave it out",
        ),
        (
            "resolution = 1.0",
            'resolution = 1.0\nmargin = 1.2\nwake = "sting"',
            r"mesh\.margin: says nothing with wake = 'sting'; allowed: leave it out",
        ),
        ("mach = 2.0", "mach = 5.0", r"comparison\.measured: was flown from Mach 1\.077 to 4\.3, not at 5; allowed"),
        ("mach = 2.0\n", "", r"f\.toml: condition\.mach: missing; allowed: a number"),
        ("mach = 2.0", "mach = = 2.0", r"f\.toml: not valid TOML: .*line "),
        ("diameter_m = 0.030", "diameter_mm = 30.0", r"shape\.diameter_mm: unknown key; did you mean 'diameter_m'"),
        ("amplitude_deg = 0.25", "amplitude_rad = 0.004", r"unknown key; did you mean '.*amplitude_deg'"),
        ("diameter_m = 0.030", 'diameter_m = "30 mm"', r"shape\.diameter_m: is '30 mm'; allowed: a number in metres"),
        ("diameter_m = 0.030", "diameter_m = -0.03", r"shape\.diameter_m: is -0.03; allowed: a number in metres great"),
        ("root_chord_calibres = 1.0", "root_chord_calibres = 9.0", r"shape\.fins\.root_chord_calibres: reaches onto"),
        ("k = 0.1", "k = -0.1", r"forced_oscillation\.k: is -0.1; allowed: a number in omega c/2V greater than 0"),
        (
            "k = [0.2",
            "k = [-0.2",
            r"operator\.k: is -0\.2; allowed: a list, each a number in omega c/2V at ",
        ),
        ("k = [0.2, 0.5]", "k = 0.05", r"operator\.k: is 0\.05; allowed: a list, each a number in omega c/2V"),
        (
            '["alpha", "q", "p"]',
            '["alpha", "q", "w"]',
            r"operator\.inputs: is 'w'; allowed: a list, each 'alpha' or 'q'",
        ),
        (
            "[rom]",
            "[flow]\nsteady_tolerance = 1e-5\n[rom]",
            r"flow\.steady_tolerance: is 1e-05; allowed: .* most 1e-06",
        ),
        ('["alpha", "q", "p"]', '["alpha"]', r"operator\.inputs: lacks alpha or q.* allowed: both"),
        ('["alpha", "q", "p"]', '["alpha", "q", "q"]', r"operator\.inputs: holds one twice; allowed: each once"),
        ('nose = "cone"', 'nose = "blunt"', r"shape\.nose: is 'blunt'; allowed: 'cone' or 'tangent_ogive'"),
        ("[vehicle]", "[vehcile]", r"f\.toml: vehcile: unknown key; did you mean 'vehicle'"),
        ("axial_inertia_kg_m2 = 1.92e-4", "axial_inertia_kg_m2 = 1.0", r"vehicle\.axial_inertia_kg_m2: no body has it"),
        (
            "initial_alpha_deg = 2.5\ninitial_beta_deg = 1.5",
            "initial_alpha_deg = 0.0",
            r"flight\.initial_alpha_deg: is 0",
        ),
        ("seed = 1", "seed = 1.5", r"range\.seed: is 1\.5; allowed: a whole number"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(right, wrong, message):
    assert right in QUICK
    with pytest.raises(InputError, match=message) as caught:
        parse_case(QUICK.replace(right, wrong, 1), "f.toml")
    assert "\n" not in str(caught.value)


def test_missing_and_unreadable_files_are_named(tmp_path):
    with pytest.raises(InputError, match=r"nothing\.toml: cannot be read \(No such file"):
        read_case(tmp_path / "nothing.toml")
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="cannot be read"):
        read_case(binary)


def test_reference_page_lists_every_key():
    page = case_reference()
    for key in ("mach", "trailing_edge_calibres", "steps_per_period", "transverse_inertia_kg_m2", "workers"):
        assert f"| `{key}` |" in page


def test_subsonic_flow_asks_for_distance_ahead_of_the_nose():
    subsonic = QUICK.replace("mach = 2.0", "mach = 0.8").replace("basic_finner_range", "none")
    near = subsonic.replace("resolution = 1.0", 'resolution = 1.0\nwake = "sting"')
    with pytest.raises(InputError, match=r"mesh\.upstream_calibres: is 2, too short .* at least 10 below Mach 1"):
        parse_case(near)
    far = near.replace('"sting"', '"sting"\nupstream_calibres = 20.0')
    assert parse_case(far).mesh.upstream_calibres == 20.0
