"""Force surfaces from the command line: made of held levels, kept, shown, drawn, cut at constant force, and refused."""

import json

import numpy as np
import pytest

from identification import FrequencyResponse
from rig.results.files import load, save

OMEGA, ZETA, SHAPE, CUBIC = 2.0 * np.pi * 40.0, 0.004, 1.3, 3e8
LEVELS_M = np.geomspace(5e-4, 2.4e-3, 20)
FORCE_N = 0.55


def stiffness(omega, amplitude_m):
    """Dynamic stiffness of one mode with a cubic spring, one harmonic."""
    stiff = OMEGA**2 + 0.75 * CUBIC * SHAPE**2 * np.square(amplitude_m)
    return (stiff - omega**2 + 2j * ZETA * OMEGA * omega) / SHAPE**2


def held_level(level_m):
    resonance = np.sqrt(OMEGA**2 + 0.75 * CUBIC * SHAPE**2 * level_m**2)
    omega = resonance * (1.0 + ZETA * np.linspace(-2.2, 2.2, 7))
    motion = np.full(7, level_m + 0j)
    force = stiffness(omega, level_m) * motion
    label = f"{1e3 * level_m:.3g} mm"
    return FrequencyResponse(omega / (2 * np.pi), force, motion, "displacement", "response", level_m, label, "duffing")


def at_constant_force(force_n):
    """The closed form at a few amplitudes below resonance: the frequency of ``|S(W)| X = F``, by bisection."""
    frequencies, motions = [], []
    for amplitude in (1.1e-3, 1.3e-3, 1.5e-3):
        low, high = 0.9 * OMEGA, np.sqrt(OMEGA**2 + 0.75 * CUBIC * SHAPE**2 * amplitude**2)
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if abs(stiffness(middle, amplitude)) * amplitude > force_n else (low, middle)
        frequencies.append(low)
        motions.append(amplitude * np.exp(-1j * np.angle(stiffness(low, amplitude))))
    hz = np.array(frequencies) / (2 * np.pi)
    force = np.full(3, force_n + 0j)
    return FrequencyResponse(hz, force, np.array(motions), "displacement", "force", force_n, "closed form", "duffing")


@pytest.fixture
def made(command, tmp_path):
    save(tuple(held_level(x) for x in LEVELS_M), tmp_path / "held.h5")
    save((at_constant_force(FORCE_N),), tmp_path / "reference.h5")
    done = command("identify held.h5 --model force-surface -o surface.h5")
    assert not done.status, done.err
    return done


def test_a_surface_is_shown_level_by_level_with_the_level_that_would_tell_most(made, command):
    assert "20 levels of displacement" in made.out
    summary = json.loads(command("show surface.h5 --json").out)
    levels = summary["levels"]
    np.testing.assert_allclose([level["amplitude_m"] for level in levels], LEVELS_M)
    np.testing.assert_allclose([level["points"] for level in levels], 7)
    resonance = np.sqrt(OMEGA**2 + 0.75 * CUBIC * SHAPE**2 * LEVELS_M**2)
    np.testing.assert_allclose([level["frequency_hz"] for level in levels], resonance / (2 * np.pi), rtol=1e-6)
    np.testing.assert_allclose(
        [level["force_n"] for level in levels], 2 * ZETA * OMEGA * resonance / SHAPE**2 * LEVELS_M, rtol=1e-4
    )
    assert LEVELS_M[0] < summary["next_level_m"] < LEVELS_M[-1]


def test_a_contour_is_the_closed_form_and_is_compared_with_a_reference_at_every_lag(made, command, tmp_path):
    done = command("predict surface.h5 --frequency-response 0.6 --reference reference.h5 -o curves.h5 --json")
    assert not done.status, done.err
    summary = json.loads(done.out)
    assert [one["force_n"] for one in summary["frequency_responses"]] == [0.6, FORCE_N]
    (error,) = summary["errors"]
    assert error["envelope_error"] < 0.003
    for curve in load(tmp_path / "curves.h5").steady:
        size = np.abs(stiffness(2 * np.pi * curve.frequency_hz, curve.amplitude_m())) * curve.amplitude_m()
        np.testing.assert_allclose(size, curve.force_n, rtol=5e-3)
        assert not curve.stable.all()
        assert curve.range_use.max() < 1.0
        assert any("leaving out every second level" in note for note in curve.notes)


@pytest.mark.slow
def test_surface_and_curves_are_drawn(made, command, tmp_path):
    command("predict surface.h5 --frequency-response 0.6 -o curves.h5")
    for name in ("surface", "curves"):
        assert not command(f"plot {name}.h5 -o {name}.png").status
        assert (tmp_path / f"{name}.png").stat().st_size > 20_000


def test_a_nonlinear_mode_comes_of_the_same_levels(made, command, tmp_path):
    assert not command("identify held.h5 -o mode.h5").status
    mode = load(tmp_path / "mode.h5")
    np.testing.assert_allclose(mode.amplitude_m, LEVELS_M)
    damping = ZETA * OMEGA / (2 * np.pi * mode.modal_frequency_hz)
    np.testing.assert_allclose(mode.damping_ratio, damping, rtol=5e-3)


def test_its_levels_are_exported_as_the_frequency_responses_that_they_are(made, command, tmp_path):
    assert not command("export surface.h5 --to uff -o levels.uff").status
    assert not command("import levels.uff --format uff -o back.h5").status
    back = load(tmp_path / "back.h5")
    np.testing.assert_allclose([one.level for one in back], LEVELS_M)
    np.testing.assert_allclose(back[3].force, held_level(LEVELS_M[3]).force, rtol=1e-9)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("identify reference.h5 --model force-surface -o x.h5", "'closed form' held force, must hold the response"),
        (
            "identify held.h5 --model force-surface --count 2 -o x.h5",
            "--count: does not apply to --model force-surface",
        ),
        (
            "identify surface.h5 --model force-surface -o x.h5",
            "holds a force-surface; a force surface comes from respon",
        ),
        ("predict surface.h5 --frequency-response 9 -o x.h5", "force_n = 9 N: levels at lag"),
        (
            "predict surface.h5 --frequency-response 0.6 --force rms -o x.h5",
            "--force: does not apply to a force surface",
        ),
        ("predict surface.h5 --sweep held.h5 -o x.h5", "--sweep: does not apply to a force surface"),
        ("predict surface.h5 --reference held.h5 -o x.h5", "'0.5 mm' is not at constant force"),
        ("predict surface.h5 -o x.h5", "nothing to predict: give --frequency-response"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(made, command, line, said):
    done = command(line)
    assert done.status == 1
    assert said in done.err
    assert done.err.count("\n") == 1
