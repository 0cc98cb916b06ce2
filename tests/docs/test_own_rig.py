"""A rig of one's own from its pages alone: files taken from it, commands as they are typed, an independent truth."""

import json
import math
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from rig.bench import load_bench
from rig.drivers import make_daq
from rig.results.files import load
from rig.tick.layout import DEVICE_SHIFT
from simulators.analysis import phase_resonance_backbone
from simulators.kernels import Flag
from tests.command import Ended, run_command
from tests.docs.pages import ROOT, blocks, write

TUTORIAL, FORCE_LAW = ROOT / "docs/tutorials/a-rig-of-your-own.md", ROOT / "docs/how-to/write-a-force-law.md"
PARTS = ROOT / "docs" / "reference" / "virtual-rig-parts.md"
STIFFNESS_N_M, GAP_M = 2000.0, 0.0005
CLAMPED = 1.8751040687119611  # first root of cosh(x) cos(x) = -1
PRESS_FIT = """
base = "magnet-beam"

[[driver.options.friction]]
kind = "jenkins"
at = "tip"
stiffness = [1e5]
slip = [1e-5]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The files of the pages, as a reader would copy them."""
    path = tmp_path_factory.mktemp("laboratory")
    for page in (TUTORIAL, FORCE_LAW):
        for block in blocks(page):
            if block.file:
                write(block, path)
    return path


def typed(line: str, folder: Path) -> Ended:
    """What comes of a command, typed in the folder; the force law there is forgotten afterwards."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(sys, "path", [*sys.path])
        ended = run_command(line)
    sys.modules.pop("drag", None)
    return ended


def piecewise_backbone(linear_hz: float, tip: float, tops_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequency (Hz) and modal fundamental of the free oscillator ``q'' + w0^2 q + k phi (phi q - g)+ = 0``, exactly.

    It is two half circles in its two phase planes: with the stop about a shifted equilibrium, without about zero.
    """
    free, gap = 2.0 * math.pi * linear_hz, GAP_M / tip
    stopped = math.sqrt(free**2 + STIFFNESS_N_M * tip**2)
    centre = STIFFNESS_N_M * tip * GAP_M / stopped**2
    frequencies, fundamentals = [], []
    for top in tops_m / tip:
        inner = top - centre
        touching = math.acos((gap - centre) / inner) / stopped
        outer = math.hypot(gap, stopped * math.sqrt(inner**2 - (gap - centre) ** 2) / free)
        lead = math.acos(gap / outer)
        half = touching + (math.pi - lead) / free
        t = (np.arange(20000) + 0.5) * half / 20000
        q = np.where(t < touching, centre + inner * np.cos(stopped * t), outer * np.cos(free * (t - touching) + lead))
        frequencies.append(0.5 / half)
        fundamentals.append(2.0 * float(np.mean(q * np.cos(math.pi * t / half))))
    return np.array(frequencies), np.array(fundamentals)


@pytest.fixture(scope="module")
def model(folder):
    for line in ("run end-stop-plan.toml -o own.h5", "identify own.h5 -o own-model.h5"):
        typed(line, folder).succeeded()
    return load(folder / "own-model.h5")


def test_the_commands_of_the_page_are_those_typed_here():
    text = TUTORIAL.read_text(encoding="utf-8")
    assert "rig run end-stop-plan.toml -o" in text
    assert "rig identify end-stop.h5 -o" in text


def test_below_the_gap_it_is_the_clamped_beam_of_the_textbook(model):
    radius_m, speed_m_s = 0.008 / math.sqrt(12.0), math.sqrt(210e9 / 7850.0)
    linear_hz = CLAMPED**2 / (2.0 * math.pi) * speed_m_s * radius_m / 0.5**2
    assert model.modal_frequency_hz[0] == pytest.approx(linear_hz, rel=2e-5)
    assert model.damping_ratio[0] == pytest.approx(0.002, rel=5e-3)


def test_the_stop_raises_the_frequency_as_it_does_a_free_piecewise_linear_oscillator(model, folder):
    virtual = make_daq(load_bench(folder / "end-stop.toml")).rig
    tip = float(virtual.linear_modes.at(virtual.shape("tip"))[0])
    assert tip == pytest.approx(2.0 / math.sqrt(7850.0 * 0.5 * 0.04 * 0.008), rel=1e-6)  # closed form: 2 / sqrt(mass)
    frequency, fundamental = piecewise_backbone(26.73655, tip, np.linspace(0.00051, 0.0045, 200))
    expected = np.interp(model.modal_amplitude[1:], fundamental, frequency)
    # One mode without shaker against three with it: they differ by 2e-4 at most, the stop raises by 0.013 to 0.040.
    np.testing.assert_allclose(model.modal_frequency_hz[1:], expected, rtol=3e-4)
    assert np.all(np.diff(model.modal_frequency_hz) > 0.2)


def test_it_agrees_with_harmonic_balance_of_the_coupled_rig(model, folder):
    virtual = make_daq(load_bench(folder / "end-stop.toml")).rig
    truth = phase_resonance_backbone(virtual, voltages_v=[0.1, 0.3, 0.6, 1.2], harmonics=30)
    np.testing.assert_allclose(model.modal_frequency_hz, truth.modal_frequency_hz, rtol=2e-5)
    np.testing.assert_allclose(model.damping_ratio, truth.damping_ratio, rtol=5e-3)
    np.testing.assert_allclose(model.force_n, truth.force_n, rtol=3e-3)
    for harmonic in (2, 3):
        np.testing.assert_allclose(
            model.force_harmonic_ratio(harmonic)[1:], truth.force_harmonic_ratio(harmonic)[1:], rtol=0.02
        )


def test_the_force_law_of_the_page_damps_as_the_energy_that_it_takes(folder):
    done = typed("run plate-plan.toml -o plate.h5 --json", folder).succeeded()
    without = typed("run plate-plan.toml --bench magnet-beam -o bare.h5 --json", folder).succeeded()
    virtual = make_daq(load_bench("magnet-beam")).rig
    modes = virtual.linear_modes
    ratio = float(modes.at(virtual.shape("tip"))[0] / modes.drive_shape[0])
    for drag, bare in zip(*(json.loads(one.out)["points"] for one in (done, without)), strict=True):
        # Energy of c v |v| per period, 8/3 c w^2 X^3, over 2 pi w^2 q^2 / 2 is 4 pi zeta: zeta = 4/(3 pi) c X phi^2.
        tip_m = ratio * drag["amplitude_m"]
        added = 4.0 / (3.0 * math.pi) * 0.05 * tip_m * (ratio * modes.drive_shape[0]) ** 2
        assert drag["damping_ratio"] - bare["damping_ratio"] == pytest.approx(
            added, rel=0.03, abs=4e-6
        )  # 4e-6 is a thousandth of the damping, its noise at these levels


@pytest.mark.parametrize(
    ("name", "old", "new", "fault"),
    [
        (
            "end-stop.toml",
            'at = "drive"\nstiffness',
            'at = "dirve"\nstiffness',
            "stinger.at = 'dirve'; allowed:",
        ),
        (
            "end-stop.toml",
            "thickness_m = 0.008",
            "thickness_m = -0.008",
            "thickness_m = -0.008 m; allowed: greater than 0",
        ),
        ("end-stop.toml", "gap_m = 0.0005", "gap_m = -0.0005", "gap_m = -0.0005 m; allowed:"),
        ("end-stop.toml", "gap_m = 0.0005", "gap_mm = 0.5", "gap_m: is missing; "),
        ("end-stop.toml", "tip = 0.50 }", "tip = 0.60 }", "points_m.tip = 0.6; allowed: 0 to length_m = 0.5"),
        ("end-stop.toml", 'role = "response"', 'role = "drive"', "channels: 2 with role 'drive'; allowed: exactly 1"),
        ("drag.py", "def quadratic", "def cubic", "function = 'drag:quadratic'"),
    ],
)
def test_a_slip_of_the_pen_is_answered_by_one_line_that_names_it(folder, tmp_path, name, old, new, fault):
    for source in folder.iterdir():
        if source.suffix in (".toml", ".py"):
            (tmp_path / source.name).write_text(source.read_text(encoding="utf-8"), encoding="utf-8")
    text = (tmp_path / name).read_text(encoding="utf-8")
    assert old in text
    (tmp_path / name).write_text(text.replace(old, new, 1), encoding="utf-8")
    plan = "plate-plan.toml" if name == "drag.py" else "end-stop-plan.toml"
    done = typed(f"run {plan} -o no.h5", tmp_path)
    assert done.status == 1
    assert done.err.count("\n") == 1, done.err
    assert fault in done.err
    assert not list(tmp_path.glob("no.h5*"))


def test_a_joint_that_is_stiffer_than_the_beam_is_refused(folder):
    (folder / "press-fit.toml").write_text(PRESS_FIT, encoding="utf-8")
    done = typed("run plate-plan.toml --bench press-fit.toml -o no.h5", folder)
    assert done.status == 1
    assert "friction: stiffness 100000" in done.err


def test_every_flag_is_on_the_page_of_parts_with_its_bit():
    shown = re.findall(r"^\| `(\w+)` \| (\d+) \|", PARTS.read_text(encoding="utf-8"), re.MULTILINE)
    assert [(name, 1 << (int(bit) - DEVICE_SHIFT)) for name, bit in shown] == [
        (str(flag.name).lower(), int(flag)) for flag in Flag
    ]
