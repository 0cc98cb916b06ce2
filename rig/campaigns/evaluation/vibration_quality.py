"""Quality of a recorded vibration: purity of force and response, bias of the damping due to harmonics, scatter of the lag."""

import math

import numpy as np

from identification import PeriodicVibration
from rig.bench import Bench
from rig.campaigns.evaluation.point import Purity, Spectrum, Vibration
from rig.campaigns.evaluation.rows import Rows, mean_of, std_of, stretches
from rig.campaigns.evaluation.vibrations import quantisation_warnings
from rig.text.column import Column

_SHARED = (
    Column("force_n", "force", "N", ".4f", plain=True),
    Column("frequency_hz", "frequency", "Hz", ".4f", plain=True),
    Column("amplitude_m", "amplitude", "mm", ".4f", 1e3, plain=True),
    Column("damping_ratio", "damping", "%", ".4f", 100.0, plain=True),
    Column("damping_ratio_std", "+-", "%", ".4f", 196.0, in_line=False, optional=True),
    Column("phase_error_deg", "phase error", "deg", ".2f"),
    Column("level_error", "level error", "%", ".2f", 100.0),
)
FINE_AMPLITUDE = Column("amplitude_m", "amplitude", "mm", ".5f", 1e3, plain=True)
"""Column of an amplitude that is held, or whose changes count."""
PURITY_COLUMNS = (
    Column("force_purity", "force purity", "%", ".2f", 100.0),
    Column("response_purity", "response purity", "%", ".2f", 100.0, in_line=False),
    Column("power_indicator", "mode indicator", "%", ".2f", 100.0, in_line=False),
)
"""Last columns in the tables of all campaigns under a phase lock."""

BIASED_DAMPING = 0.01
"""Power of all higher harmonics over that of the fundamental, above which the two dampings differ too much."""
OTHER_MODE = 0.1  # a nonlinear resonance this far from the linear one more likely belongs to another mode
FORCE_HARMONICS = "force harmonics"
"""How the remark on them begins."""
SCATTERING_DEG = 5.0  # a larger scatter of the lag indicates a signal that hardly exceeds noise and converter steps


def shared_columns(*keys: str) -> tuple[Column, ...]:
    """Return columns that tables of several kinds of campaigns have, by their keys."""
    return tuple(next(column for column in _SHARED if column.key == key) for key in keys)


def purity(vibration: PeriodicVibration) -> Purity:
    """Return the purity of force, response and power, from the first harmonic up; 1 is pure.

    ``force_purity``, ``response_purity``: ``|Y_1| / sqrt(sum |Y_h|^2)`` of force and drive-point displacement.
    ``power_indicator``: active over apparent power, ``P / (F_rms V_rms)`` with ``P = sum P_h``, ``P_h = Re(F_h conj(V_h))/2``;
    1 if the force is in phase with the velocity at every instant. ``harmonic_power``: ``sum_{h>1} P_h / P_1``, the relative
    difference between damping from the whole power and damping from the fundamental. All are NaN if there is no force or no
    motion.
    """
    force, motion = vibration.force[1:], vibration.drive_m[1:]
    orders = np.arange(1, force.size + 1)
    velocity = 2j * math.pi * vibration.frequency_hz * orders * motion
    powers = 0.5 * np.real(force * np.conj(velocity))
    apparent = 0.5 * float(np.linalg.norm(force) * np.linalg.norm(velocity))
    with np.errstate(divide="ignore", invalid="ignore"):
        return Purity(
            force_purity=float(np.abs(force[0]) / np.linalg.norm(force)),
            response_purity=float(np.abs(motion[0]) / np.linalg.norm(motion)),
            power_indicator=float(powers.sum() / np.float64(apparent)),
            harmonic_power=float(powers[1:].sum() / powers[0]),
        )


def lag_scatter_deg(rows: Rows) -> float:
    """Standard deviation of the lag as measured by the detector, deg; NaN in open loop."""
    errors = (stretch["phase_error_rad"] for stretch in stretches(rows))
    return math.degrees(std_of(seen[np.isfinite(seen)].astype(float) for seen in errors))


def quality_warnings(bench: Bench, vibration: PeriodicVibration, rows: Rows, held: bool = True) -> tuple[str, ...]:
    """Return warnings about a recorded vibration, except about its damping. The scatter of a lag not ``held`` is ignored."""
    out = [*vibration.warnings, *quantisation_warnings(vibration, bench)]
    scatter = lag_scatter_deg(rows) if held else 0.0
    if scatter > SCATTERING_DEG:
        force = bench.channels[bench.index_of("force")]
        bits = vibration.force_n / force.resolution_in_unit
        out.append(
            f"the lag scatters by {scatter:.1f} deg (warning above {SCATTERING_DEG:g} deg): too little signal (force "
            f"{vibration.force_n:.3g} N, {bits:.1f} steps of its converter), or a detector that is too fast"
        )
    linear_hz = bench.specimen.linear_frequency_hz
    if math.isfinite(scatter) and abs(vibration.frequency_hz / linear_hz - 1.0) > OTHER_MODE:
        out.append(
            f"perhaps another mode at {vibration.frequency_hz:.4g} Hz: more than {100.0 * OTHER_MODE:g} % from "
            f"specimen.linear_frequency_hz = {linear_hz:g}, and the phase alone cannot tell one mode from another"
        )
    return tuple(out)


def damping_bias(vibration: PeriodicVibration) -> tuple[str, ...]:
    """Return a remark if damping from all harmonics of the force differs from that of the fundamental; empty if it does not.

    It is a warning where a test asks for damping, and a note where it does not.
    """
    share = purity(vibration).harmonic_power
    if share is None or not abs(share) > BIASED_DAMPING:
        return ()
    size, side = f"{100.0 * abs(share):.1f} %", "lower" if share < 0.0 else "higher"
    return (
        f"{FORCE_HARMONICS} (damping ±{size}): damping from all harmonics is {size} {side} than from the fundamental "
        f"(warning above {100.0 * BIASED_DAMPING:g} %)",
    )


def vibration_part(vibration: PeriodicVibration, rows: Rows) -> Vibration:
    """Return the part of a point that describes the vibration in its ``rows``."""
    return Vibration(
        frequency_hz=vibration.frequency_hz,
        force_n=vibration.force_n,
        amplitude_m=vibration.amplitude_m,
        voltage_v=mean_of(np.abs(stretch["command_v"]) for stretch in stretches(rows)),
        purity=purity(vibration),
        periods=vibration.periods,
        spectrum=Spectrum(
            harmonics=vibration.harmonics,
            harmonics_std=vibration.harmonics_std,
            residual_rms=vibration.residual_rms,
            drift=vibration.drift,
            rounding_std=vibration.rounding_std,
        ),
    )
