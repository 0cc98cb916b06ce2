"""Structured models as virtual rigs: the motion is that of the model, by time steps and by harmonic balance."""

from dataclasses import replace

import numpy as np
import pytest

from identification import Exciter, IdentificationError, NonlinearElement, StructuredModel, backbone
from identification.models import (
    BoucWen,
    Coulomb,
    Jenkins,
    Masing,
    PolynomialDamper,
    PolynomialSpring,
    Stribeck,
    UserSpring,
)
from rig.authoring.new_files import new_file
from rig.bench import load_bench
from rig.bench.cross_checks import cautions
from rig.drivers import make_daq
from rig.drivers.virtual import VirtualDAQ
from rig.errors import ConfigurationError
from rig.results.files import save
from rig.results.structured.virtual_bench import structured_bench
from simulators import Simulation
from simulators.analysis import phase_resonance_backbone
from tests.identification.models.structured.models import beam
from tests.refused import refused
from tests.rig.authoring.test_schemas import of, read
from tests.simulators.references import UNFILTERED

FINE_HZ = 20000.0


def rig_of(model, **converter):
    return VirtualDAQ(load_bench_of(model)).rig._changed(
        {"noise_scale": 0.0, "converter": converter_of(model, converter)}
    )


def load_bench_of(model):
    from rig.bench import Bench

    return Bench.model_validate(structured_bench(model, load_bench("magnet-beam")))


def converter_of(model, changes):
    rig = VirtualDAQ(load_bench_of(model)).rig
    return rig.converter.model_copy(update=changes)


def jointed() -> StructuredModel:
    """Two modes and one element: a polynomial spring and damper, and four sliders, one of them without stiffness."""
    masing = Masing((0.4, 0.0, 0.3, 0.5), (0.05, 0.1, 0.3, 0.8))
    laws = (PolynomialSpring((1.0, 1.5)), PolynomialDamper((0.0, 0.3)), masing)
    element = NonlinearElement(direction=[0.9, -0.1], scale_m=1e-3, laws=laws, largest=1.0)
    return beam(elements=(element,), direct=np.zeros((3, 1)), damping_ratio=[0.004, 0.02])


def burst(rig, seconds):
    t = np.arange(round(seconds * FINE_HZ)) / FINE_HZ
    lines, generator = np.arange(12.0, 45.0, 1.0 / seconds), np.random.default_rng(3)
    waves = np.cos(2.0 * np.pi * np.outer(t, lines) + generator.uniform(0.0, 2.0 * np.pi, lines.size)).sum(axis=1)
    rise = np.sin(0.5 * np.pi * np.minimum(t / 0.2, 1.0)) ** 2
    return Simulation(rig).run(3.0 * rise * waves / np.std(waves))


@pytest.mark.parametrize("make", [beam, jointed], ids=["two elements, Jenkins and Iwan", "one element, Masing"])
def test_the_rig_moves_as_the_model_does_under_the_same_force(make):
    model = make()
    rig = rig_of(model, sample_rate_hz=FINE_HZ, substeps=2, dac_bits=0, **UNFILTERED)
    run = burst(rig, 1.5)
    own = replace(
        model, sample_rate_hz=FINE_HZ, steps=1, support_n_m=0.0, direct=np.zeros((3, 1)),
        outputs=tuple(replace(channel, unit="m") for channel in model.outputs),
    )  # fmt: skip
    found = own.simulate(run.force_n[None])
    assert found.reach_use.max() > 0.3  # the elements take part
    for channel, simulated in zip(model.outputs, found.outputs, strict=True):
        moved = run.displacement_m[channel.name]
        assert np.sqrt(np.mean((moved - simulated) ** 2) / np.mean(moved**2)) < 2e-4, channel.name


def test_a_large_feed_through_is_a_free_mode_with_this_mass_line_and_a_small_one_is_left_out():
    outputs = tuple(replace(channel, unit="m/s2") for channel in beam().outputs)
    model = beam(outputs=outputs, direct=[[0.3], [0.2], [-0.1]])
    table = structured_bench(model, load_bench("magnet-beam"))
    structure = table["driver"]["options"]["structure"]
    assert structure["frequency_hz"][0] == 0.0
    assert "left out" not in table["description"]
    shapes = {name: shape[0] for name, shape in structure["shapes"].items()}
    for channel, direct in zip(outputs, model.direct[:, 0], strict=True):
        assert shapes[channel.name] * shapes["drive"] == pytest.approx(direct)
    assert shapes["element_1"] == shapes["element_2"] == 0.0
    small = structured_bench(beam(outputs=outputs), load_bench("magnet-beam"))
    assert "left out: 0.01 m/s2 per N to drive" in small["description"]
    assert len(small["driver"]["options"]["structure"]["frequency_hz"]) == 2


def test_phase_resonance_of_rig_and_model_agree_by_harmonic_balance():
    # Two programs: one of voltage, exciter and structure in physical sites, one of modal coordinates.
    model = replace(jointed(), support_n_m=0.0)
    rig, forces = rig_of(model), [0.1, 0.6]
    found = phase_resonance_backbone(rig, forces_n=forces, excitation="pure-sine", harmonics=9, near_hz=25.0)
    for force_n, hz, amplitude_m in zip(forces, found.frequency_hz, found.amplitude_m, strict=True):
        own = backbone(model, force_n, harmonics=9, largest_range_use=3.0)
        assert hz == pytest.approx(own.frequency_hz[-1], rel=1e-5)
        assert amplitude_m == pytest.approx(abs(own.displacement_m[-1][1, 0]), rel=1e-3)


@pytest.mark.slow
def test_a_backbone_measured_on_the_rig_is_that_of_the_model_behind_its_exciter(tmp_path):
    import rig as program

    model = jointed()
    new_file("rig", tmp_path / "mine.toml", table=structured_bench(model, load_bench("magnet-beam")))
    (tmp_path / "plan.toml").write_text(
        'kind = "backbone"\nbench = "mine.toml"\nlevels_v = [0.3, 0.8, 1.2]\nrecord_periods = 50\n[controller]\n'
        'detector = "two-phase"\nlow_pass_rad_s = 6.283185307179586\nk1 = 2.0\nk2 = 6.283185307179586\n'
        "centre_frequency_hz = 25.0\nfrequency_window_hz = [22.0, 28.0]\nperiod_mean = true\n",
        encoding="utf-8",
    )
    with program.run(str(tmp_path / "plan.toml"), output=tmp_path / "backbone.h5", seed=1) as run:
        points = run.backbone()
    part = VirtualDAQ(load_bench(tmp_path / "mine.toml")).rig
    shaker, stinger = part.exciter, part.stinger
    exciter = Exciter(
        force_per_volt_n_v=shaker.force_factor_n_a / shaker.resistance_ohm,
        coil_time_constant_s=shaker.inductance_h / shaker.resistance_ohm,
        moving_mass_kg=shaker.armature_mass_kg,
        suspension_damping_n_s_m=shaker.suspension_damping_n_s_m,
        suspension_stiffness_n_m=shaker.suspension_stiffness_n_m,
        back_emf_damping_n_s_m=shaker.force_factor_n_a**2 / shaker.resistance_ohm,
        stinger_compliance_m_n=1.0 / stinger.stiffness_n_m,
        stinger_damping_time_s=stinger.damping_n_s_m / stinger.stiffness_n_m,
        covariance=np.zeros((8, 8)),
    )
    held = replace(
        model, support_n_m=shaker.suspension_stiffness_n_m, support_corner_hz=1e-3, support_largest_n=1e6
    )  # the suspension itself
    for k in range(3):
        own = backbone(held, float(points.force_n[k]), force="fundamental", exciter=exciter, largest_range_use=3.0)
        assert points.frequency_hz[k] == pytest.approx(own.frequency_hz[-1], rel=2e-5)
        assert points.amplitude_m[k] == pytest.approx(abs(own.displacement_m[-1][1, 0]), rel=2e-3)


def test_the_bench_has_the_channels_of_the_model_and_the_facts_of_its_rig(tmp_path):
    new_file("rig", tmp_path / "mine.toml", table=structured_bench(jointed(), load_bench("magnet-beam")))
    bench = load_bench(tmp_path / "mine.toml")
    assert [(c.name, c.role) for c in bench.channels] == [
        ("force", "force"), ("drive", "drive"), ("tip", "response"), ("middle", "response"),
    ]  # fmt: skip
    assert not make_daq(bench).remarks
    assert cautions(bench) == ()
    of("bench").validate(read(tmp_path / "mine.toml"))
    assert len((tmp_path / "mine.toml").read_text(encoding="utf-8")) < 30_000


def test_a_shaker_by_name_replaces_that_of_the_bench_and_stands_at_one_that_is_not_virtual():
    like = load_bench("magnet-beam")
    own = structured_bench(jointed(), like, shaker="lds-v203")["driver"]["options"]
    assert own["exciter"] == {"shaker": "lds-v203"}
    real = like.model_copy(update={"driver": like.driver.model_copy(update={"name": "serial", "options": {}})})
    options = structured_bench(jointed(), real, shaker="modal-shop-2100e11")["driver"]["options"]
    assert options["exciter"] == {"shaker": "modal-shop-2100e11"}
    with refused(ConfigurationError, "shaker-is-missing-the-bench-magnet"):
        structured_bench(jointed(), real)


TWICE = {"input_shapes": [[0.9, 1.4], [1.6, -0.5]], "direct": np.zeros((3, 2))}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            TWICE | {"inputs": tuple(replace(beam().inputs[0], name=n) for n in ("a", "b"))},
            {"says": "inputs-are-a-force-b"},
        ),
        ({"inputs": (replace(beam().inputs[0], role="monitor"),)}, {"says": "are-force-monitor-allowed-is-one"}),
        (
            {"outputs": tuple(replace(c, role="response") for c in beam().outputs)},
            {"says": "allowed-is-exactly-one-of-role"},
        ),
        ({"input_shapes": [[0.8], [1.6]]}, {"says": "output-shapes-that-of-drive-is"}),
    ],
)
def test_a_model_that_no_rig_can_be_is_refused(change, message):
    with refused(IdentificationError, **message):
        structured_bench(beam(**change), load_bench("magnet-beam"))


def pushing(x, numbers):
    return numbers[0] + x**3


def test_a_spring_that_pushes_at_rest_is_refused():
    element = NonlinearElement(direction=[0.9, 0.0], scale_m=1e-3, laws=(UserSpring(f"{__name__}:pushing", (0.5,)),))
    with refused(IdentificationError, "element-its-springs-have-n-at"):
        structured_bench(beam(elements=(element,)), load_bench("magnet-beam"))


@pytest.mark.parametrize("law", [BoucWen(), Coulomb(), Stribeck()])
def test_a_joint_that_no_virtual_rig_has_is_refused(law):
    element = NonlinearElement(direction=[0.9, 0.0], scale_m=1e-3, laws=(law,))
    with refused(IdentificationError, "element-has-a-joint-of-no-rig"):
        structured_bench(beam(elements=(element,)), load_bench("magnet-beam"))


def test_from_the_command_line(command, tmp_path):
    laws = (UserSpring(f"{__name__}:pushing", (0.0,)), Jenkins(1.0, 0.5))
    element = NonlinearElement(direction=[0.9, 0.0], scale_m=1e-3, laws=laws)
    save(beam(elements=(element,)), tmp_path / "own.h5")
    save(jointed(), tmp_path / "model.h5")
    for line, message in (
        ("--from none.h5 --bench magnet-beam", "none.h5"),
        ("--from model.h5", "--bench: is missing, a bench or a recording of one"),
        ("--from own.h5 --bench magnet-beam", "is not imported unless you trust it: --trust-code"),
        ("--from model.h5 --bench magnet-beam --shaker none", "shaker = 'none'; allowed: "),
        ("--shaker lds-v203", "--shaker: is for a rig that begins with a model, --from"),
    ):
        status, out, err = command(f"new rig {line} -o mine.toml")
        assert (status, out, err.count("\n")) == (1, "", 1), err
        assert message in err
    assert not (tmp_path / "mine.toml").exists()
    status, _, err = command("new plan --from model.h5 --bench magnet-beam -o mine.toml")
    assert (status, "`rig new rig`" in err) == (1, True)
    made = command("new rig --from own.h5 --bench magnet-beam --trust-code -o mine.toml").succeeded()
    assert made.out.startswith("mine.toml: structured model of a specimen behind the exciter of the bench magnet-beam;")
    kinds = [element["kind"] for element in load_bench("mine.toml").driver.options["elements"]]
    assert kinds == ["force-table", "cubic"]  # the function is numbers now: the bench names no code
