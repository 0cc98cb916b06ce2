from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from simulators.sensing.parts import Converter
from simulators.virtual_rig import VirtualRig
from tests.refused import refused


def table(**changes: Any) -> dict[str, Any]:
    """The one-sided specimen written out, with changes."""
    full = VirtualRig.shipped("magnet-beam").model_dump() | {"specimen": None}
    for key, value in changes.items():
        full[key] = full[key] | value if isinstance(value, dict) else value
    return full


JOINT = {"kind": "jenkins", "at": "clamp", "quantity": "curvature", "relative_to_mode_1": True}
MAGNET = {"kind": "magnet-one-sided", "at": "magnet", "strength_n_m4": 1e-8, "gap_m": 0.011}
STOP = {"kind": "clearance", "at": "magnet", "gap_m": 0.005, "contact_stiffness_n_m": 1e4}
MODAL = {"kind": "modal", "frequency_hz": [20.0, 30.0], "damping_ratio": [0.01, 0.01]}

BAD: list[tuple[dict[str, Any], str]] = [
    (
        {"specimen": "magnet-beem"},
        {"field": "specimen", "value": "magnet-beem", "allowed": "friction-beam, magnet-beam, magnet-beam-symmetric"},
    ),
    ({"specimen": "magnet-beam", "voltage": 1}, {"field": "voltage", "value": 1}),
    ({"specimen": "magnet-beam", "exciter": {"armature_mass": 0.2}}, {"field": "exciter.armature_mass", "value": 0.2}),
    ({"specimen": "magnet-beam", "exciter": {"armature_mass_kg": -0.2}}, {"says": "greater-than"}),
    (
        {"specimen": "magnet-beam", "exciter": {"armature_mass_kg": "0.2"}},
        {"field": "exciter.armature_mass_kg", "value": "0.2"},
    ),
    *(
        (
            {"specimen": "magnet-beam", "converter": {"substeps": substeps}},
            {"where": "converter.substeps", "value": substeps, "allowed": "1 to 1024, or 'auto'"},
        )
        for substeps in (0, 2.5, "soon")
    ),
    (
        {"specimen": "magnet-beam", "converter": {"sample_rate_hz": float("nan")}},
        {"says": "finite-number", "field": "converter.sample_rate_hz"},
    ),
    (
        {"specimen": "magnet-beam", "structure": {"length_m": 0.4}},
        {"field": "points_m.acc_magnet", "value": 0.40065, "allowed": "0 to length_m = 0.4"},
    ),
    (
        {"specimen": "magnet-beam", "structure": {"boundary": "pinned"}},
        {"field": "structure.beam.boundary", "value": "pinned"},
    ),
    ({"specimen": "magnet-beam", "structure": {"damping_ratio": []}}, {"says": "at-least-item"}),
    (
        {"specimen": "magnet-beam", "structure": {"lumped_masses": [{"at": "x", "mass_kg": 1.0}]}},
        {
            "field": "lumped_masses[0].at",
            "value": "x",
            "allowed": "one of clamp, drive, acc_drive, acc_magnet, magnet, tip",
        },
    ),
    (
        {"specimen": "magnet-beam", "stinger": {"at": "dive"}},
        {"field": "stinger.at", "value": "dive", "allowed": "clamp, drive, acc_drive, acc_magnet, magnet, tip"},
    ),
    (
        {"specimen": "magnet-beam", "stinger": {"at": "clamp"}},
        {"field": "stinger.at", "value": "clamp", "allowed": "a point that moves"},
    ),
    (
        {"specimen": "magnet-beam", "structure": {"damping_ratio": [0.01] * 3, "frequency_hz": [20.0, 130.0, 120.0]}},
        {"field": "frequency_hz[2]", "value": 120.0, "allowed": "from 130 on, lowest first"},
    ),
    (
        table() | {"structure": MODAL | {"frequency_hz": [30.0, 20.0], "shapes": {"drive": [1.0, 1.0]}}},
        {"field": "frequency_hz[1]", "value": 20.0, "allowed": "from 30 on, lowest first"},
    ),
    (
        {"specimen": "magnet-beam", "converter": {"oversampling": 2, "anti_alias_hz": 1e-4}},
        {"field": "anti_alias_hz", "value": 0.0001, "allowed": "0, or from 5 on, 0.001 of the rate"},
    ),
    (
        {"specimen": "magnet-beam", "converter": {"oversampling": 2, "reconstruction_hz": 4.0}},
        {"field": "reconstruction_hz", "value": 4.0, "allowed": "0, or from 5 on, 0.001 of the rate"},
    ),
    (table(sensors=[]), {"says": "at-least-item"}),
    (
        table(sensors=[{"name": "a", "kind": "force", "sensitivity_v_per_unit": 1.0, "range_v": 5.0}] * 2),
        {"field": "sensors", "allowed": "one of each name"},
    ),
    (
        table(sensors=[{"name": "a", "kind": "acceleration", "sensitivity_v_per_unit": 1.0, "range_v": 5.0}]),
        {"says": "is-missing", "field": "at"},
    ),
    (
        table(friction=[JOINT | {"stiffness": [1e6], "slip": [1e-3]}]),
        {"field": "friction", "allowed": "less than the structure has there"},
    ),
    (
        table(friction=[JOINT | {"stiffness": [1.0, 2.0], "slip": [1e-3]}]),
        {"field": "slip", "allowed": "2, one per stiffness"},
    ),
    (
        table(friction=[JOINT | {"stiffness": [1.0], "slip": [1e-3], "quantity": "deflection"}]),
        {"field": "friction[0].at", "value": "clamp", "allowed": "a coordinate that mode 1 moves"},
    ),
    (table(elements=[MAGNET | {"gap_m": 0.0}]), {"says": "greater-than"}),
    (
        table(elements=[MAGNET | {"at": "tipp"}]),
        {"field": "elements[0].at", "value": "tipp", "allowed": "clamp, drive, acc_drive, acc_magnet, magnet, tip"},
    ),
    (
        table(elements=[MAGNET | {"at": "clamp"}]),
        {"field": "elements[0].at", "value": "clamp", "allowed": "a point that moves"},
    ),
    (
        table(elements=[MAGNET | {"to": "tipp"}]),
        {"field": "elements[0].to", "value": "tipp", "allowed": "clamp, drive, acc_drive, acc_magnet, magnet, tip"},
    ),
    (
        table(elements=[MAGNET | {"to": "magnet"}]),
        {"field": "elements[0].to", "value": "magnet", "allowed": "another point than at"},
    ),
    (
        table(elements=[MAGNET | {"kind": "magnet"}]),
        {"says": "magnet-one-sided-magnet-symmetric-cubic", "field": "elements.0"},
    ),
    (
        table(elements=[MAGNET, STOP | {"gap_m": 0.011}]),
        {"field": "elements[1].gap_m", "value": 0.011, "allowed": "below 0.011, where the magnet at 'magnet' touches"},
    ),
    (
        table(elements=[MAGNET | {"kind": "magnet-symmetric"}, STOP | {"other_gap_m": 0.02}]),
        {
            "field": "elements[1].other_gap_m",
            "value": 0.02,
            "allowed": "below 0.011, where the magnet at 'magnet' touches",
        },
    ),
    (table(elements=[STOP | {"contact_stiffness_n_m": 0.0}]), {"says": "greater-than"}),
    (
        table(elements=[STOP | {"contact_stiffness_n_m": 1e8}]),
        {"field": "elements[0]", "allowed": "up to 1.66258e+07, or converter.substeps of at least 10"},
    ),
    (
        table(elements=[STOP | {"contact_stiffness_n_m": 1e13}], converter={"substeps": "auto", "oversampling": 5}),
        {"field": "elements[0]", "allowed": "up to 1.08109e+12, or a higher sample rate"},  # 1.66258e+07 (1020/4)^2
    ),
    (
        table(elements=[{"kind": "cubic", "at": "magnet", "stiffness_n_m3": 1e9, "linear_n_m": -1e5}]),
        {"field": "elements", "allowed": "no more than the structure has there"},
    ),
    (
        table() | {"structure": MODAL | {"shapes": {"drive": [1.0]}}},
        {"field": "shapes.drive", "allowed": "2, one per frequency_hz"},
    ),
    (
        table(elements=[], sensors=table()["sensors"][:1])
        | {"structure": MODAL | {"shapes": {"drive": [1.0, 1.0], "clamp": [1.0, 1.0]}}},
        {"field": "friction[0].quantity", "value": "curvature", "allowed": "'deflection' where the modes are given"},
    ),
]


@pytest.mark.parametrize(("config", "message"), BAD)
def test_bad_rig_is_refused_with_the_field_and_what_is_allowed(
    config: dict[str, Any], message: dict[str, object]
) -> None:
    with refused(ValidationError, **message):
        VirtualRig.model_validate(config)


def test_written_out_table_is_a_good_one() -> None:
    assert VirtualRig.model_validate(table()).structure == VirtualRig.shipped("magnet-beam").structure


def test_parts_are_frozen() -> None:
    rig = VirtualRig.shipped("magnet-beam")
    with refused(ValidationError, field="seed", value=3):
        rig.seed = 3  # type: ignore[misc]


def test_every_field_is_described() -> None:
    def undescribed(schema: dict[str, Any]) -> list[str]:
        parts = [schema, *schema["$defs"].values()]
        return [
            f"{part['title']}.{name}"
            for part in parts
            for name, field in part["properties"].items()
            if "description" not in field
        ]

    assert undescribed(VirtualRig.model_json_schema()) == []


def test_a_step_that_is_called_long_enough_is_accepted() -> None:
    stiff = table(elements=[STOP | {"contact_stiffness_n_m": 1e8}], converter={"substeps": 12})
    assert VirtualRig.model_validate(stiff).converter.substeps == 12  # 10 or more, a multiple of the internal instants


@pytest.mark.parametrize(
    ("stiffness_n_m", "oversampling", "expected"),
    [(1e4, 1, 2), (1e4, 3, 3), (1e8, 1, 10), (1e8, 4, 12)],  # ten are needed for 1e8 N/m, see above
)
def test_auto_takes_the_fewest_steps_that_the_stiffest_stop_allows(
    stiffness_n_m: float, oversampling: int, expected: int
) -> None:
    stops = [STOP, STOP | {"contact_stiffness_n_m": stiffness_n_m}]
    converter = {"substeps": "auto", "oversampling": oversampling, "anti_alias_hz": 0.0}
    rig = VirtualRig.model_validate(table(elements=stops, converter=converter))
    assert (rig.substeps, rig.converter.substeps) == (expected, "auto")
    assert rig.build()[0].plant["substeps"][0] * oversampling == expected
    if stiffness_n_m > 1e4:
        with refused(ValidationError, field="elements[1]"):
            VirtualRig.model_validate(
                table(elements=stops, converter=converter | {"substeps": expected - oversampling})
            )


def test_steps_that_are_written_are_kept() -> None:
    assert Converter().substeps == "auto"
    assert VirtualRig.model_validate(table(converter={"substeps": 64})).substeps == 64


def test_a_stop_behind_a_one_sided_magnet_is_no_matter() -> None:
    stops = table(elements=[MAGNET, STOP | {"other_gap_m": 0.02}])
    assert len(VirtualRig.model_validate(stops).elements) == 2


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("import sys; sys.exit(3)", "SystemExit: 3"),
        ("raise RuntimeError('one\\ntwo')", "RuntimeError: one two"),
    ],
)
def test_a_module_that_fails_as_it_is_imported_is_named_in_one_line(
    source: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "failing.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    with refused(
        ValidationError,
        field="function",
        value="failing:f",
        reason=message,
        allowed="a function that can be imported",
    ):
        VirtualRig.shipped("magnet-beam", elements=[{"kind": "user", "at": "tip", "function": "failing:f"}])
