from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from simulators.virtual_rig import VirtualRig


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
        "`?specimen`? = 'magnet-beem'; allowed: friction-beam, magnet-beam, magnet-beam-symmetric",
    ),
    ({"specimen": "magnet-beam", "voltage": 1}, "voltage"),
    ({"specimen": "magnet-beam", "exciter": {"armature_mass": 0.2}}, "exciter.armature_mass\n"),
    ({"specimen": "magnet-beam", "exciter": {"armature_mass_kg": -0.2}}, "greater than 0"),
    ({"specimen": "magnet-beam", "exciter": {"armature_mass_kg": "0.2"}}, "valid number"),
    ({"specimen": "magnet-beam", "converter": {"substeps": 0}}, "greater than or equal to 1"),
    ({"specimen": "magnet-beam", "converter": {"sample_rate_hz": float("nan")}}, "finite number"),
    (
        {"specimen": "magnet-beam", "structure": {"length_m": 0.4}},
        "`?points_m.acc_magnet`? = 0.40065; allowed: 0 to length_m = 0.4",
    ),
    ({"specimen": "magnet-beam", "structure": {"boundary": "pinned"}}, "'clamped-free', 'clamped-pinned'"),
    ({"specimen": "magnet-beam", "structure": {"damping_ratio": []}}, "at least 1 item"),
    (
        {"specimen": "magnet-beam", "structure": {"lumped_masses": [{"at": "x", "mass_kg": 1.0}]}},
        r"lumped_masses\[0\].at",
    ),
    ({"specimen": "magnet-beam", "stinger": {"at": "dive"}}, "`?stinger.at`? = 'dive'; allowed: clamp, drive"),
    ({"specimen": "magnet-beam", "stinger": {"at": "clamp"}}, "`?stinger.at`? = 'clamp'; allowed: a point that moves"),
    (
        {"specimen": "magnet-beam", "structure": {"damping_ratio": [0.01] * 3, "frequency_hz": [20.0, 130.0, 120.0]}},
        r"`?frequency_hz\[2\]`? = 120(?: \S+)?; allowed: from 130 on, lowest first",
    ),
    (
        table() | {"structure": MODAL | {"frequency_hz": [30.0, 20.0], "shapes": {"drive": [1.0, 1.0]}}},
        r"`?frequency_hz\[1\]`? = 20(?: \S+)?; allowed: from 30 on, lowest first",
    ),
    (
        {"specimen": "magnet-beam", "converter": {"oversampling": 2, "anti_alias_hz": 1e-4}},
        r"`?anti_alias_hz`? = 0.0001(?: \S+)?; allowed: 0, or from 5 on",
    ),
    (
        {"specimen": "magnet-beam", "converter": {"oversampling": 2, "reconstruction_hz": 4.0}},
        r"`?reconstruction_hz`? = 4(?: \S+)?; allowed: 0, or from 5 on",
    ),
    (table(sensors=[]), "at least 1 item"),
    (
        table(sensors=[{"name": "a", "kind": "force", "sensitivity_v_per_unit": 1.0, "range_v": 5.0}] * 2),
        "two are named 'a'",
    ),
    (
        table(sensors=[{"name": "a", "kind": "acceleration", "sensitivity_v_per_unit": 1.0, "range_v": 5.0}]),
        "`?at`?: is missing",
    ),
    (table(friction=[JOINT | {"stiffness": [1e6], "slip": [1e-3]}]), r"`?friction`?: stiffness 1e\+06 in all"),
    (table(friction=[JOINT | {"stiffness": [1.0, 2.0], "slip": [1e-3]}]), "`?slip`?: has 1 values; allowed: 2"),
    (
        table(friction=[JOINT | {"stiffness": [1.0], "slip": [1e-3], "quantity": "deflection"}]),
        "a coordinate that mode 1 moves",
    ),
    (table(elements=[MAGNET | {"gap_m": 0.0}]), "greater than 0"),
    (table(elements=[MAGNET | {"at": "tipp"}]), r"`?elements\[0\].at`? = 'tipp'; allowed:"),
    (table(elements=[MAGNET | {"at": "clamp"}]), r"`?elements\[0\].at`? = 'clamp'; allowed: a point that moves"),
    (table(elements=[MAGNET | {"to": "tipp"}]), r"`?elements\[0\].to`? = 'tipp'; allowed:"),
    (table(elements=[MAGNET | {"to": "magnet"}]), r"`?elements\[0\].to`? = 'magnet'; allowed: another point"),
    (
        table(elements=[MAGNET | {"kind": "magnet"}]),
        "'magnet-one-sided', 'magnet-symmetric', 'cubic', 'clearance', 'force-table', 'damping-table', 'user'",
    ),
    (
        table(elements=[MAGNET, STOP | {"gap_m": 0.011}]),
        r"`elements\[1\].gap_m` = 0.011 m; allowed: below 0.011, where",
    ),
    (
        table(elements=[MAGNET | {"kind": "magnet-symmetric"}, STOP | {"other_gap_m": 0.02}]),
        r"`elements\[1\].other_gap_m` = 0.02 m; allowed: below 0.011",
    ),
    (table(elements=[STOP | {"contact_stiffness_n_m": 0.0}]), "greater than 0"),
    (
        table(elements=[STOP | {"contact_stiffness_n_m": 1e8}]),
        r"`elements\[0\]`: its slope of 1e\+08 N/m at 'magnet' is too steep for 4 integration steps per sample; allowed: up "
        r"to 1\.\d+e\+07, or converter.substeps of at least 10",
    ),
    (
        table(elements=[{"kind": "cubic", "at": "magnet", "stiffness_n_m3": 1e9, "linear_n_m": -1e5}]),
        "`?elements`?: their linear stiffness takes .* too much from a mode",
    ),
    (table() | {"structure": MODAL | {"shapes": {"drive": [1.0]}}}, "`?shapes.drive`?: has 1 values; allowed: 2"),
    (
        table(elements=[], sensors=table()["sensors"][:1])
        | {"structure": MODAL | {"shapes": {"drive": [1.0, 1.0], "clamp": [1.0, 1.0]}}},
        "`?quantity`? = 'curvature'",
    ),
]


@pytest.mark.parametrize(("config", "message"), BAD)
def test_bad_rig_is_refused_with_the_field_and_what_is_allowed(config: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        VirtualRig.model_validate(config)


def test_written_out_table_is_a_good_one() -> None:
    assert VirtualRig.model_validate(table()).structure == VirtualRig.shipped("magnet-beam").structure


def test_parts_are_frozen() -> None:
    rig = VirtualRig.shipped("magnet-beam")
    with pytest.raises(ValidationError, match="frozen"):
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


def test_a_stop_behind_a_one_sided_magnet_is_no_matter() -> None:
    stops = table(elements=[MAGNET, STOP | {"other_gap_m": 0.02}])
    assert len(VirtualRig.model_validate(stops).elements) == 2


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("import sys; sys.exit(3)", r"SystemExit: 3; allowed: a function that can be imported"),
        ("raise RuntimeError('one\\ntwo')", r"RuntimeError: one two; allowed: a function that can be imported"),
    ],
)
def test_a_module_that_fails_as_it_is_imported_is_named_in_one_line(
    source: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "failing.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ValidationError, match=f"`function` = 'failing:f': {message}"):
        VirtualRig.shipped("magnet-beam", elements=[{"kind": "user", "at": "tip", "function": "failing:f"}])
