"""``rig analyse``: its numbers against independent ones, its figures, and one line for every mistake."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest

from rig.analysis.backbone import backbone
from rig.analysis.balance import Balance
from rig.analysis.constant_force import constant_force, folds_of
from rig.analysis.forced import forced
from rig.analysis.levels import level_range
from rig.analysis.linear_responses import responses
from rig.analysis.modes import modes
from rig.analysis.plausible_sizes import implausible_sizes
from rig.analysis.subject import peak, subject_of
from rig.errors import ConfigurationError
from simulators.analysis import NotConvergedError, phase_resonance_backbone
from simulators.parts import BeamStructure
from tests.reference.harmonic_balance import backbone as reference_backbone, response_to_voltage
from tests.reference.parameters import ONE_SIDED
from tests.refused import refused
from tests.rig.rigs import bench_with

BENCHES = ("magnet-beam", "magnet-beam-symmetric", "friction-beam")
WEAK_EXCITER = {
    "resistance_ohm": 200.0,
    "armature_mass_kg": 0.02,
    "suspension_stiffness_n_m": 0.0,
    "suspension_damping_n_s_m": 0.0,
}
"""Nearly a source of constant force, so that sweeps jump."""


@pytest.mark.parametrize("bench", BENCHES)
@pytest.mark.parametrize(
    ("what", "held"),
    [
        ("modes", {"structure", "coupled"}),
        ("responses", {"frequency_hz", "force_n_per_v", "acceleration_m_s2_per_v", "acceleration_m_s2_per_n"}),
        ("backbone --points 3", {"points", "loops", "frequency_shift"}),
        ("constant-force --points 5", {"curves", "backbone"}),
        ("forced --points 5", {"up", "down", "force", "voltage_v"}),
    ],
)
def test_every_analysis_of_every_shipped_bench_needs_nothing_but_its_name(command, tmp_path, bench, what, held):
    status, out, err = command(f"analyse {what} --bench {bench} --json -o figure.png")
    assert status == 0, err
    summary = json.loads(out)
    assert held <= set(summary)
    assert summary["bench"] == bench
    assert summary["complete"]
    assert (tmp_path / "figure.png").stat().st_size > 20_000


@pytest.mark.parametrize("what", ["modes", "responses", "backbone", "constant-force", "forced"])
def test_every_analysis_prints_units_in_its_headings(command, what):
    status, out, _ = command(f"analyse {what} --bench magnet-beam{' --points 5' if what != 'modes' else ''}")
    assert status == 0
    assert "magnet beam (one-sided) (bench magnet-beam)" in out
    assert " Hz" in out


def test_modes_are_those_of_the_papers_and_the_coupled_rig_is_far_from_them():
    found = modes(subject_of("friction-beam"))
    bending_hz = found.structure.frequency_hz[2:]
    np.testing.assert_allclose(bending_hz, [149.0, 564.3, 1138.3, 1496.5], rtol=1e-3)
    assert found.subject.mode == 2
    assert found.subject.frequency_hz == bending_hz[0]
    magnets = modes(subject_of("magnet-beam"))
    assert magnets.structure.damping_ratio[0] == pytest.approx(0.004, rel=1e-3)
    assert magnets.channel_shapes["drive"] == pytest.approx(magnets.structure.drive_shape)
    assert set(magnets.channel_shapes) == {"drive", "acc_drive", "acc_magnet"}
    assert magnets.coupled.damping_ratio[0] > 10 * magnets.structure.damping_ratio[0]


def test_accelerance_is_the_sum_over_the_modes_and_joins_the_other_two_responses():
    subject = subject_of("magnet-beam")
    found, linear = responses(subject), modes(subject)
    w, own = 2 * np.pi * found.found.frequency_hz[:, None], 2 * np.pi * linear.structure.frequency_hz
    damping = 2 * np.diag(linear.structure.damping_ratio) * own
    for name, accelerance in found.accelerance_per_kg.items():
        shapes = linear.channel_shapes[name] * linear.structure.drive_shape
        near = np.abs(w[:, 0] / own[0] - 1.0) < 0.05
        expected = (-(w**2) * shapes / (own**2 - w**2 + 1j * w * np.diag(damping))).sum(axis=1)
        np.testing.assert_allclose(accelerance[near], expected[near], rtol=2e-3)
        np.testing.assert_allclose(found.acceleration_per_v[name], accelerance * found.force_n_per_v, rtol=1e-8)


def test_responses_resolve_every_resonance_in_their_range():
    subject = subject_of("magnet-beam")
    found = responses(subject, from_hz=100.0, to_hz=400.0, points=2)
    f = found.found.frequency_hz
    assert f[0] == pytest.approx(100.0)
    assert f[-1] == pytest.approx(400.0)
    for mode_hz, damping in zip(
        subject.rig.linear_modes.frequency_hz, subject.rig.linear_modes.damping_ratio, strict=True
    ):
        if 100.0 < mode_hz < 400.0:
            assert np.count_nonzero(np.abs(f / mode_hz - 1.0) < damping) >= 5


def test_the_backbone_is_that_of_the_reference_with_levels_in_newtons_or_volts():
    subject = subject_of("magnet-beam")
    found = backbone(subject, lowest=0.026, highest=0.56, points=4)
    truth = reference_backbone(ONE_SIDED, np.geomspace(0.026, 0.56, 4).tolist())
    np.testing.assert_allclose(found.responses.frequency_hz, [one.frequency_hz for one in truth], rtol=1e-6)
    np.testing.assert_allclose(found.responses.voltage_v, [one.voltage_v for one in truth], rtol=1e-4)
    np.testing.assert_allclose(found.responses.damping_ratio, [one.damping_ratio for one in truth], rtol=1e-4)
    volts = found.responses.voltage_v
    again = backbone(subject, by="voltage", lowest=volts[0], highest=volts[-1], points=2)
    np.testing.assert_allclose(again.responses.force_n, [0.026, 0.56], rtol=1e-5)
    assert [point["force_n"] for point in again.summary()["points"]] == pytest.approx([0.026, 0.56], rel=1e-5)


def test_what_the_joints_lose_and_the_modal_damping_make_up_the_active_power():
    found = backbone(subject_of("friction-beam"), points=3)
    r, rig = found.responses, found.subject.rig
    mode = rig.linear_modes
    for point, loops in found.loops.items():
        period_s = 1.0 / r.frequency_hz[point]
        orders = np.arange(r.force_harmonics_n.shape[1])
        speeds = 2j * np.pi * r.frequency_hz[point] * orders * r.drive_harmonics_m[point]
        put_in_j = 0.5 * np.real(r.force_harmonics_n[point] * np.conj(speeds)).sum() * period_s
        w = 2 * np.pi * r.frequency_hz[point]
        k = found.subject.mode
        viscous_j = (
            2 * np.pi * w * mode.damping_ratio[k] * 2 * np.pi * mode.frequency_hz[k] * r.modal_amplitude[point] ** 2
        )
        lost_j = sum(loop.dissipated_j for loop in loops) + viscous_j
        assert lost_j == pytest.approx(put_in_j, rel=0.01)


@pytest.mark.parametrize("bench", BENCHES)
def test_default_levels_end_where_the_limits_of_the_bench_end_them(bench):
    subject = subject_of(bench)
    found = backbone(subject, points=3)
    assert np.all(subject.within(found.responses))
    assert not any("limit" in note for note in found.notes)
    further = backbone(subject, lowest=found.responses.force_n[-1], highest=1.5 * found.responses.force_n[-1], points=2)
    assert not subject.within(further.responses)[-1]
    assert any("limit" in note or "clip" in note or "converter" in note for note in further.notes)


def test_the_largest_value_over_a_period_is_that_of_the_sampled_waveform():
    theta = np.linspace(0.0, 2.0 * np.pi, 100_000)
    harmonics = np.array([[0.3, 1.0 - 0.5j, 0.4j, 0.2]])
    wave = sum((harmonics[0, h] * np.exp(1j * h * theta)).real for h in range(4))
    assert peak(harmonics)[0] == pytest.approx(np.max(np.abs(wave)), rel=1e-3)


def test_curves_at_constant_force_meet_the_backbone_and_name_their_folds():
    found = constant_force(subject_of("magnet-beam"), [0.55, 0.03], points=41)
    assert list(found.curves) == [0.03, 0.55]
    assert folds_of(found.curves[0.03]) == []
    low, high = folds_of(found.curves[0.55])
    top = found.curves[0.55]
    assert top.frequency_hz[~top.stable].min() == low < high <= found.resonances.frequency_hz[-1] * 1.001
    resonance = int(np.argmin(np.abs(top.phase_lag_deg + 90.0)))
    truth = reference_backbone(ONE_SIDED, [0.55])[0]
    assert top.frequency_hz[resonance] == pytest.approx(truth.frequency_hz, rel=1e-6)
    assert found.resonances.frequency_hz[-1] == pytest.approx(truth.frequency_hz, rel=1e-6)


def test_a_forced_response_is_that_of_the_reference_and_drops_out_at_resonance():
    found = forced(subject_of("magnet-beam"), voltage_v=1.0, from_hz=10.0, to_hz=40.0, points=60)
    for k in (0, found.up.frequency_hz.size // 2, -1):
        truth = response_to_voltage(ONE_SIDED, [1.0], float(found.up.frequency_hz[k]))[0]
        assert found.up.force_n[k] == pytest.approx(truth.force_amplitude_n, rel=1e-3)
    share = found.summary()["force"]["up"]
    assert share["lowest_share"] < 0.07
    assert share["highest_share"] > 1.1
    assert found.differ_hz.size == 0


def test_where_branches_end_rising_and_falling_frequency_differ_and_each_jumps_to_the_other():
    bench = bench_with(exciter=WEAK_EXCITER)
    found = forced(subject_of(bench), voltage_v=25.0, points=120)
    assert found.complete
    np.testing.assert_array_equal(found.up.frequency_hz, found.down.frequency_hz)
    assert np.all(np.diff(found.up.frequency_hz) > 0)
    between = (found.up.frequency_hz > 24.9) & (found.up.frequency_hz < 25.2)
    assert np.all(found.up.amplitude_m[between] > 2.0 * found.down.amplitude_m[between])
    assert np.all((found.differ_hz > 24.3) & (found.differ_hz < 25.6))
    assert any("falling frequency ends" in note for note in found.notes)


def test_all_numbers_are_in_the_json_complex_ones_as_pairs(command):
    status, out, _ = command("analyse backbone --bench magnet-beam --from-n 0.1 --to-n 0.5 --points 2 --json")
    assert status == 0
    point = json.loads(out)["points"][-1]
    assert np.hypot(*point["force_harmonics_n"][1]) == pytest.approx(0.5, rel=1e-6)
    assert set(point["sensor_harmonics"]) == {"force", "drive", "acc_drive", "acc_magnet"}
    assert point["flags"] == []
    assert {"frequency_hz", "voltage_v", "damping_ratio", "amplitude_m", "modal_amplitude"} <= set(point)


def test_the_specimen_that_scatters_is_analysed_as_the_nominal_one_and_that_is_said():
    subject = subject_of(bench_with(scatter={"frequency": 0.02}))
    found = modes(subject)
    assert found.structure.frequency_hz[0] == pytest.approx(24.37, abs=1e-3)
    assert any("nominal" in note for note in found.summary()["notes"])
    assert not modes(subject_of("magnet-beam")).summary()["notes"]


@pytest.mark.parametrize(
    ("sizes", "said"),
    [
        ({"length_m": 300.0}, ["less than 1 Hz", "thickness_m = 0.008 is 2.67e-05 of length_m = 300"]),
        ({"thickness_m": 8.0}, ["more than half of sample_rate_hz = 5000", "thickness_m = 8 is 16 of length_m = 0.5"]),
        ({}, []),
    ],
)
def test_sizes_in_another_unit_are_told(sizes, said):
    beam = {"kind": "beam", "length_m": 0.5, "width_m": 0.04, "thickness_m": 0.008, "youngs_modulus_pa": 2.1e11}
    beam |= {"density_kg_m3": 7850.0, "damping_ratio": [0.002], "points_m": {}, **sizes}
    structure = BeamStructure.model_validate(beam)
    waves = np.sqrt(structure.youngs_modulus_pa / (12.0 * structure.density_kg_m3))
    frequency_hz = 1.8751**2 / (2.0 * np.pi) * structure.thickness_m * waves / structure.length_m**2  # clamped-free
    notes = implausible_sizes(SimpleNamespace(structure=structure), frequency_hz, 5000.0)
    assert len(notes) == len(said)
    assert all(text in note for text, note in zip(said, notes, strict=True))


def test_another_mode_is_followed_where_one_asks_for_it():
    found = backbone(subject_of("magnet-beam", near_hz=130.0), by="voltage", lowest=0.01, highest=0.02, points=2)
    assert found.responses.frequency_hz[0] == pytest.approx(134.06, rel=1e-3)
    assert found.summary()["mode"]["number"] == 2


def test_a_structure_given_by_its_modes_is_drawn_at_its_points(command, tmp_path):
    (tmp_path / "modal.toml").write_text(
        'base = "magnet-beam"\n[driver.options]\nfriction = []\nelements = []\n[driver.options.structure]\n'
        'kind = "modal"\nfrequency_hz = [24.37]\ndamping_ratio = [0.004]\n'
        "[driver.options.structure.shapes]\ndrive = [0.908466]\nacc_drive = [1.0]\nacc_magnet = [1.4]\n"
    )
    for what in ("modes", "backbone --points 3"):
        status, out, err = command(f"analyse {what} --bench modal.toml -o figure.svg")
        assert status == 0, err
        assert "lost per period" not in out
        assert (tmp_path / "figure.svg").stat().st_size > 5000


def test_levels_out_of_reach_end_the_table_with_a_note_and_status_one(command, monkeypatch):
    def ends_early(rig, forces_n, **how):
        raise NotConvergedError("no vibration at 7 N", phase_resonance_backbone(rig, forces_n=forces_n[:2], **how))

    monkeypatch.setattr("rig.analysis.balance.phase_resonance_backbone", ends_early)
    status, out, err = command("analyse backbone --bench magnet-beam --from-n 0.1 --to-n 0.5 --points 3 --json")
    assert (status, err) == (1, "")
    summary = json.loads(out)
    assert not summary["complete"]
    assert len(summary["points"]) == 2
    assert "ends after 2 of 3 levels: no vibration at 7 N" in summary["notes"]


def test_where_nothing_at_all_is_found_one_line_says_so(command, monkeypatch):
    def finds_nothing(*_, **__):
        raise NotConvergedError("no vibration at 0.1 N")

    monkeypatch.setattr("rig.analysis.balance.phase_resonance_backbone", finds_nothing)
    status, out, err = command("analyse backbone --bench magnet-beam --from-n 0.1 --to-n 0.5")
    assert (status, out) == (1, "")
    assert err.startswith("rig: no vibration at resonance found at the lowest level: no vibration at 0.1 N")


def test_leaving_the_valid_range_is_said():
    found = backbone(subject_of("magnet-beam"), lowest=5.0, highest=15.0, points=2)
    assert any("beyond the range" in note for note in found.notes)


def test_a_voltage_beyond_the_amplifier_is_said_and_ends_the_default_levels():
    bench = bench_with(exciter={"voltage_limit_v": 0.5})
    found = backbone(subject_of(bench), points=2)
    assert 0.4 < found.responses.voltage_v[-1] <= 0.5
    beyond = backbone(subject_of(bench), by="voltage", lowest=0.4, highest=0.8, points=2)
    assert any("limit of 0.5 V" in note for note in beyond.notes)


def test_a_bench_that_may_not_be_driven_at_resonance_at_all_says_what_forbids_it():
    bench = bench_with({"limits": {"displacement_m": 1e-9}})
    lowest = f"already at {0.01 * bench.limits.voltage_v:g} V the bench may not be driven at resonance"
    with refused(ConfigurationError, "displacement-in-one-point-alone", reason=lambda text: text.startswith(lowest)):
        backbone(subject_of(bench))


def test_a_resonance_outside_of_the_bench_s_frequencies_is_the_reason_whatever_higher_levels_would_leave():
    bench = bench_with({"limits": {"frequency_hz": (8.0, 12.0)}})
    with pytest.raises(ConfigurationError) as caught:
        level_range(Balance(subject_of(bench), 7), "force", None, None, points=5)
    found = re.fullmatch(
        r"already at 0\.095 V the bench may not be driven at resonance "
        r"\(the resonance at (.*) Hz is outside of limits\.frequency_hz = 8 to 12 Hz\)",
        str(caught.value),
    )
    assert found is not None
    (truth,) = reference_backbone(ONE_SIDED, [0.001])  # at so small a level it is that of small vibrations
    assert float(found[1]) == pytest.approx(truth.frequency_hz, rel=2e-3)


@pytest.mark.parametrize(
    ("line", "status", "named"),
    [
        ("modes", 2, "--bench"),
        ("modes --bench nosuch", 1, "magnet-beam-symmetric"),
        ("modes --bench real.toml", 1, "driver.name = 'mine'"),
        ("modes --bench magnet-beam --near-hz -3", 1, "--near-hz = -3"),
        ("modes --bench magnet-beam -o x.gif", 1, ".png"),
        ("modes --bench magnet-beam -o nowhere/x.png", 1, "cannot be written"),
        ("responses --bench magnet-beam --from-hz 10 --to-hz 9", 1, "--from-hz = 10"),
        ("responses --bench magnet-beam --points 1", 1, "points = 1"),
        ("backbone --bench magnet-beam --to-n 1 --to-v 3", 1, "--to-v"),
        ("backbone --bench magnet-beam --from-n 3 --to-n 1", 1, "--from-n = 3"),
        ("backbone --bench magnet-beam --from-v nan", 1, "--from-v = nan"),
        ("backbone --bench magnet-beam --harmonics 0", 2, "--harmonics"),
        ("constant-force --bench magnet-beam --force-n -1", 1, "--force-n = -1"),
        ("forced --bench magnet-beam --voltage-v 0", 1, "--voltage-v = 0"),
        ("forced --bench magnet-beam --from-hz 30 --to-hz inf", 1, "--to-hz = inf"),
        ("nonsense", 2, "nonsense"),
    ],
)
def test_a_mistake_is_answered_in_one_line(command, tmp_path, line, status, named):
    (tmp_path / "real.toml").write_text('base = "magnet-beam"\n[driver]\nname = "mine"\n')
    code, out, err = command(f"analyse {line}")
    assert code == status
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    assert err.startswith("rig: ")
    assert named in err
    assert [path.name for path in tmp_path.iterdir()] == ["real.toml"]
