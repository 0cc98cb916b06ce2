"""``rig identify`` for exciters and held responses: its numbers against the rig's own, and one line for every mistake."""

import json

import numpy as np
import pytest

import rig
from identification.exciter_coupling import PARAMETERS
from rig.campaigns.plans import load_plan, plan_from
from rig.drivers.virtual.driver import VirtualDAQ
from rig.recording.reader import Recording
from rig.results.files import load
from rig.results.linear_modes.identify import identify
from rig.results.linear_modes.options import LinearOptions
from simulators import VirtualRig
from simulators.analysis import phase_resonance_backbone
from tests.recorded import recorded_at


def test_an_exciter_is_that_of_the_rig_within_its_errors(command, shelf):
    done = command(f"show {shelf}/EX.h5 --json")
    summary = json.loads(done.out)
    assert (summary["kind"], summary["specimen"]) == ("exciter", "magnet-beam, magnet beam (one-sided)")
    assert summary["band_hz"] == [8.0, 200.0]
    found = summary["parameters"]
    assert set(found) == {*PARAMETERS, "damping_n_s_m"}
    own = VirtualRig.shipped("magnet-beam").exciter
    gain = own.amplifier_gain * own.force_factor_n_a / own.resistance_ohm
    damping = own.suspension_damping_n_s_m + own.force_factor_n_a**2 / own.resistance_ohm
    for name, value, within in (
        ("force_per_volt_n_v", gain, 2e-4),
        ("moving_mass_kg", own.armature_mass_kg, 5e-3),
        ("suspension_stiffness_n_m", own.suspension_stiffness_n_m, 1e-3),
        ("damping_n_s_m", damping, 5e-4),
    ):
        assert found[name]["value"] == pytest.approx(value, rel=within)
        assert abs(found[name]["value"] - value) < 4.0 * found[name]["std"]
    assert found["damping_n_s_m"]["std"] < 0.01 * found["suspension_damping_n_s_m"]["std"]


def test_an_exciter_is_shown_with_units_and_drawn(command, shelf, tmp_path):
    shown = command(f"show {shelf}/EX.h5")
    assert shown.status == 0
    for text in ("damping by both", "N s/m", "moving mass", "rely on their sum"):
        assert text in shown.out
    assert command(f"plot {shelf}/EX.h5 -o EX.png").status == 0
    assert (tmp_path / "EX.png").stat().st_size > 20_000


def test_a_known_resistance_and_stinger_make_the_moving_mass_surer(command, shelf, monkeypatch):
    monkeypatch.chdir(shelf)
    own = VirtualRig.shipped("magnet-beam")
    known = f"--resistance {own.exciter.resistance_ohm} --amplifier-gain {own.exciter.amplifier_gain}"
    known += f" --stinger-stiffness {own.stinger.stiffness_n_m}"
    done = command(f"identify exciter.h5 --model exciter {known} -o known.h5 --json")
    assert done.status == 0, done.err
    told = json.loads(done.out)["parameters"]
    alone = json.loads(command("show EX.h5 --json").out)["parameters"]
    assert told["moving_mass_kg"]["std"] < 0.7 * alone["moving_mass_kg"]["std"]
    assert told["back_emf_damping_n_s_m"]["std"] < 0.01 * alone["back_emf_damping_n_s_m"]["std"]
    for name, value in (
        ("moving_mass_kg", own.exciter.armature_mass_kg),
        ("back_emf_damping_n_s_m", own.exciter.force_factor_n_a**2 / own.exciter.resistance_ohm),
        ("suspension_damping_n_s_m", own.exciter.suspension_damping_n_s_m),
    ):
        assert told[name]["value"] == pytest.approx(value, rel=5e-3)
        assert abs(told[name]["value"] - value) < 4.0 * told[name]["std"]


def test_a_modal_fit_asks_the_driver_of_the_recorded_bench_for_images_of_the_output(shelf, monkeypatch):
    path, without = shelf / "modal.h5", load(shelf / "LIN.h5").modes
    monkeypatch.setattr(VirtualDAQ, "image_shares", lambda self, hz: {"force": np.full(hz.size, 2e-3)})
    modes = identify([path], LinearOptions(count=2)).modes  # a force that reads 0.2 % too much
    np.testing.assert_array_equal(modes.frequency_hz, without.frequency_hz)
    systematic = np.sqrt(modes.shapes_std[0] ** 2 - without.shapes_std[0] ** 2)
    np.testing.assert_allclose(systematic, 1e-3 * np.abs(without.shapes[0]), rtol=0.1)  # its square goes with the force
    monkeypatch.setattr(VirtualDAQ, "image_shares", lambda self, hz: {})
    np.testing.assert_array_less(identify([path], LinearOptions(count=2)).modes.shapes_std, 1.0001 * without.shapes_std)


@pytest.mark.parametrize(
    ("kind", "options", "first", "planned"),
    [
        ("modal", "--model linear --count 2", "1 of 2 points of the plan", "(1 of 2 at 0.05 V RMS)"),
        ("exciter", "--model exciter", "1 of 2 points of the plan", "(1 of 2 at 1 V RMS)"),
        ("backbone", "--modes LIN.h5", "1 of 7 points of the plan", "(1 of 1 at 0.2 V)"),
    ],
)
def test_points_that_were_not_accepted_are_counted_in_a_note(
    command, shelf, monkeypatch, kind, options, first, planned
):
    def points(recording):
        measured = [point for part in recording.parts for point in part.points]
        return [p if p["number"] != 1 else {**p, "accepted": False, "reason": "shaken by hand"} for p in measured]

    monkeypatch.chdir(shelf)
    monkeypatch.setattr(Recording, "points", property(points))
    done = command(f"identify {kind}.h5 {options} -o fewer-{kind}.h5")
    assert done.status == 0, done.err
    wanted = f"note: {kind}.h5: {first} were not accepted and are left out {planned}; the first: shaken by hand"
    assert wanted in done.out
    assert "not accepted" not in command("show LIN.h5").out


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("exciter.h5 modal.h5 --model exciter", "2 files given, allowed is one multisine recording"),
        ("backbone.h5 --model exciter", "holds a backbone; an exciter model comes from a multisine"),
        ("exciter.h5 --model exciter --modes LIN.h5", "--modes: does not apply to --model exciter, which takes --band"),
        ("exciter.h5 --model exciter --band 100 50", "--band = 100 50"),
        ("exciter.h5 --model exciter --resistance 0", "--resistance = 0: allowed is any number above 0"),
        (
            "exciter.h5 --model exciter --stinger-stiffness nan",
            "--stinger-stiffness = nan: allowed is any number above 0",
        ),
        ("exciter.h5 --model exciter --amplifier-gain 2", "--amplifier-gain: is for the resistance; add --resistance"),
        (
            "modal.h5 --model linear --resistance 3",
            "--resistance: does not apply to --model linear, which takes --estimator",
        ),
        ("exciter.h5 --model exciter --band 20 22", "9 excited lines in 20 to 22 Hz; allowed: at least 20"),
        ("exciter.h5 --model shaker", "--model = 'shaker'"),
        ("nothing.h5 --model exciter", "nothing.h5"),
    ],
)
def test_every_mistake_is_named_in_one_line_and_leaves_no_file(command, shelf, monkeypatch, line, said):
    monkeypatch.chdir(shelf)
    done = command(f"identify {line} -o wrong.h5")
    assert done.status != 0
    assert said in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert not (shelf / "wrong.h5").exists()


def test_five_lags_of_the_friction_beam_give_its_mode_as_harmonic_balance_has_it(command, tmp_path):
    shipped = load_plan("friction-beam/response-controlled").model_dump(exclude_none=True)
    plan = plan_from(shipped | {"levels_m": [5.5e-5, 6.56e-5, 7.83e-5]}, "three levels")
    recorded_at(tmp_path / "held.h5", plan, seed=1)
    done = command("identify held.h5 -o mode.h5 --json")
    assert done.status == 0, done.err
    mode = load(tmp_path / "mode.h5")
    truth = phase_resonance_backbone(VirtualRig.shipped("friction-beam"), forces_n=np.geomspace(0.8, 1.8, 16))
    for name, within in (("modal_frequency_hz", 2e-5), ("damping_ratio", 0.003)):
        expected = np.interp(mode.amplitude_m, truth.amplitude_m, getattr(truth, name))
        np.testing.assert_allclose(getattr(mode, name), expected, rtol=within)
        assert np.all(np.isfinite(mode.interval(name)))


def test_a_held_rms_gives_responses_and_not_a_mode(command, tmp_path):
    shipped = load_plan("magnet-beam/stepped-phase").model_dump(exclude_none=True)
    shipped = {name: value for name, value in shipped.items() if name not in ("start_deg", "stop_deg", "step_deg")}
    plan = plan_from(shipped | {"levels_rms_n": [0.1], "phase_lags_deg": [-110.0, -90.0, -70.0]}, "three lags")
    with rig.run(plan, output=tmp_path / "lags.h5", seed=1) as run:
        assert run.complete
    done = command("identify lags.h5 -o mode.h5")
    assert done.status != 0
    assert "lags.h5: frequency responses" in done.err
    assert not (tmp_path / "mode.h5").exists()
