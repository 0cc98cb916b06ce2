"""From the recorded rows of a stepped-sine point to its result, and from the results to frequency responses in memory."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from identification import FrequencyResponse, IdentificationError
from identification.frequency_responses import Controlled
from rig.bench import Bench
from rig.campaigns.evaluation.alien_force import alien_force
from rig.campaigns.evaluation.objections import alien_objection, drift_objection, first_of, level_error, level_objection
from rig.campaigns.evaluation.quality import PURITY_COLUMNS, of_a_record
from rig.campaigns.evaluation.vibrations import as_complex, head, not_evaluated, recorded_vibration, within_periods
from rig.campaigns.planning.drift import of_the_result
from rig.campaigns.planning.plan import Column, Target
from rig.campaigns.stepped_sine.plan import SteppedSinePlan

__all__ = ["STEPPED_SINE_COLUMNS", "frequency_responses_of", "measure_stepped_sine_point"]

TRUSTED_ALIEN_FORCE = 0.1  # what no lock holds is warned of, where plans under a lock accept no more

CONTROLLED: dict[str, Controlled] = {"V": "voltage", "N": "force", "N RMS": "none", "m": "response"}
"""What was held, by the unit of the levels."""

STEPPED_SINE_COLUMNS = (
    Column("frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("force_n", "force", "N", ".4f", plain=True),
    Column("amplitude_m", "amplitude", "mm", ".5f", 1e3, plain=True),
    Column("phase_lag_deg", "phase lag", "deg", ".2f"),
    *PURITY_COLUMNS,
)


def measure_stepped_sine_point(
    bench: Bench, plan: SteppedSinePlan, target: Target, rows: np.ndarray, settling: np.void
) -> dict[str, Any]:
    """The result of a recorded point, with its own quality; ``settling`` is the outcome record of its settle segment."""
    rows = rows[within_periods(rows["theta_rad"], plan.record_periods)]
    try:
        vibration = recorded_vibration(bench, rows, plan.harmonics)
    except (IdentificationError, ArithmeticError) as error:
        return not_evaluated(plan, target, error, settled=True)
    harmonics = np.abs(vibration.harmonics[bench.index_of("force"), 1:])
    force_rms_n = float(np.sqrt(0.5 * np.sum(harmonics**2)))
    missed = level_error(plan.amplitude_law, target.level, vibration, force_rms_n)
    reason = first_of(
        (
            level_objection(plan.amplitude_law, missed, plan.accepted_level_error),
            drift_objection(bench, vibration, plan.accepted_drift),
        )
    )
    alien = alien_force(bench, [rows])
    point = of_a_record(bench, vibration, rows, settling)
    point["warnings"] += filter(None, [alien_objection(alien, TRUSTED_ALIEN_FORCE)])
    return {
        **head(plan, target),
        "settled": True,
        "accepted": not reason,
        "reason": reason,
        "frequency_hz": vibration.frequency_hz,
        "force_n": vibration.force_n,
        "amplitude_m": vibration.amplitude_m,
        "level_error": missed,
        "phase_lag_deg": vibration.phase_lag_deg,
        "alien_force": alien,
        **point,
    }


def frequency_responses_of(
    points: Iterable[Mapping[str, Any]], channels: Sequence[Mapping[str, Any]], specimen: str
) -> tuple[FrequencyResponse, ...]:
    """The accepted points of a recording, one frequency response per level and pass.

    A held RMS of the force is ``controlled = "none"``: no fundamental is constant. Raises `IdentificationError` where no point
    was accepted.
    """
    roles = [channel["role"] for channel in channels]
    force, drive = roles.index("force"), roles.index("drive")
    passes: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for point in of_the_result(points):
        if point["accepted"]:
            passes.setdefault(tuple(point[key] for key in ("level", "direction", "repeat", "level_unit")), []).append(
                point
            )
    if not passes:
        raise IdentificationError("points: none of the recording was accepted")
    out = []
    for (level, direction, repeat, unit), accepted in passes.items():
        frequency_hz = np.array([point["frequency_hz"] for point in accepted])
        fundamentals = np.array([as_complex(point["harmonics"])[:, 1] for point in accepted])
        to_displacement = -1.0 / (2.0 * np.pi * frequency_hz) ** 2
        out.append(
            FrequencyResponse(
                frequency_hz=frequency_hz,
                force=fundamentals[:, force],
                response=np.asarray(
                    fundamentals[:, drive] * to_displacement if unit == "m" else fundamentals[:, drive]
                ),
                kind="displacement" if unit == "m" else "acceleration",
                controlled=CONTROLLED[unit],
                level=level,
                label=_label(level, unit, direction, repeat, [one for one in passes if one[0] == level]),
                specimen=specimen,
            )
        )
    return tuple(out)


def _label(level: float, unit: str, direction: str, repeat: int, alike: Sequence[tuple[Any, ...]]) -> str:
    """The level, and of direction and repeat what tells it from the others of its level."""
    size = f"{1e3 * level:.4g} mm" if unit == "m" else f"{level:g} {unit}"
    size += f" {direction}" if len({other[1] for other in alike}) > 1 else ""
    return size + (f" {repeat}" if len({other[2] for other in alike}) > 1 else "")
