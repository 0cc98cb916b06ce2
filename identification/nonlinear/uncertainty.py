"""Monte Carlo propagation of measurement errors to the properties of a nonlinear mode.

Random errors are independent between points and between runs: those of the Fourier coefficients of all channels and
harmonics, drawn from Student's distribution for the number of batches behind a standard error, and that of the slope of the
drift. Systematic errors are the same in a further run. Some are the same at all points: mass-normalised shapes, gains of the
channels, and phase skew (a delay: the phase of harmonic h changes h times as much). The rounding by the converters is another
one at every point (`identification.signals.rounding`). The damping goes with the square of the mode shape at the drive point,
so that twice the relative standard error of this shape is in that of the damping.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from identification.backbones import Backbone
from identification.channels import MOTION_ORDER, find_role
from identification.errors import IdentificationError
from identification.linear.mode_shapes import ModeShapes
from identification.measurements import PeriodicVibration
from identification.nonlinear.nonlinear_modes import QUANTITIES, STANDARD_ERRORS
from identification.nonlinear.properties import States, properties
from identification.signals.fourier import batches_of
from identification.signals.rounding import part_of_each
from vibrolock.arrays import Complex, Float

_BOUNDED = ("mac", "force_purity", "response_purity")
_TAILS = (2.5, 97.5)  # %; percentiles at the ends of a 95 % interval
_STANDS_OUT = 2.5  # multiple of its standard error per part; noise alone causes such a drift in 4 % of cases


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """Errors of a backbone other than the noise in the standard errors of its points."""

    calibration_std: float | Mapping[str, float] = 0.0
    """Relative standard error of the sensitivity of each channel: one number for all, or by channel name."""
    phase_skew_std_deg: float | Mapping[str, float] = 0.0
    """Standard error of each channel's phase at the fundamental: one number for all, or by channel name."""
    draws: int = 1000
    """Number of draws of the Monte Carlo; 0: errors are not computed."""
    seed: int = 0
    """Seed of the Monte Carlo; the same seed gives the same numbers."""

    def __post_init__(self) -> None:
        if self.draws != 0 and self.draws < 100:
            allowed = "at least 100, or 0 for no standard errors"
            raise IdentificationError(field="draws", value=self.draws, allowed=allowed)

    def per_channel(self, name: str, backbone: Backbone) -> Float:
        """float[n_channels]: the field ``name`` of each channel; raises `IdentificationError` for unknown channels."""
        given = getattr(self, name)
        names = [channel.name for channel in backbone.channels]
        if isinstance(given, Mapping):
            if unknown := set(given) - set(names):
                reason = f"no channel '{sorted(unknown)[0]}'"
                raise IdentificationError(reason, field=name, hint=f"channels: {', '.join(names)}")
            values = np.array([float(given.get(channel, 0.0)) for channel in names])
        else:
            values = np.full(len(names), float(given))
        if not np.all(np.isfinite(values) & (values >= 0.0)):
            raise IdentificationError(field=name, value=given, allowed="0 or above")
        return values


def propagated(
    states: States, backbone: Backbone, rows: tuple[int, ...], shapes: ModeShapes | None, model: ErrorModel
) -> dict[str, Float]:
    """Return standard errors, their systematic and random parts, and intervals, by field name of `NonlinearMode`.

    ``rows`` are the channels of ``states.deflection_m``; ``states.inverse`` is the pseudo-inverse of ``shapes``. Without draws
    there are none.
    """
    if model.draws == 0:
        return {}
    estimate = properties(states)
    rng = np.random.default_rng(model.seed)
    wrong = _systematic(states, backbone, rows, shapes, model, rng)
    both = _random(wrong if wrong is not None else _repeated(states, model.draws), states, backbone, rows, rng)
    total = _deviations(estimate, properties(both))
    systematic, random = {name: np.zeros_like(total[name]) for name in total}, total
    if wrong is not None:
        # Each part is drawn by itself: a difference of variances would be lost in the scatter of the draws.
        systematic = _deviations(estimate, properties(wrong))
        alone = _random(_repeated(states, model.draws), states, backbone, rows, rng)
        random = _deviations(estimate, properties(alone))
    known = np.array([point.harmonics_std is not None for point in backbone.points])
    out: dict[str, Float] = {}
    intervals = np.empty((len(backbone.points), len(QUANTITIES), 2))
    for column, name in enumerate(QUANTITIES):
        out[STANDARD_ERRORS[name]] = np.where(known, _std(total[name]), np.nan)
        # The errors act on the estimate as they acted on the true value: quantiles of the deviation with reversed sign.
        low, high = np.percentile(total[name], _TAILS, axis=0)
        intervals[:, column] = np.column_stack([estimate[name] - high, estimate[name] - low])
        if name in _BOUNDED:  # skewed near its bound: take the union of both intervals
            ends = np.column_stack([intervals[:, column], estimate[name] + low, estimate[name] + high])
            intervals[:, column] = np.clip(np.column_stack([ends.min(axis=1), ends.max(axis=1)]), 0.0, 1.0)
    intervals[~known] = np.nan
    return {
        **out,
        "systematic_std": np.column_stack([_std(systematic[n]) for n in QUANTITIES]),
        "random_std": np.column_stack([np.where(known, _std(random[n]), np.nan) for n in QUANTITIES]),
        "interval_95": intervals,
    }


def _std(deviations: Float) -> Float:
    return np.asarray(np.std(deviations, axis=0, ddof=1))


def _deviations(estimate: Mapping[str, Float], drawn: Mapping[str, Float]) -> dict[str, Float]:
    """Return the deviations of the draws from the estimate by quantity, float[draws, n]."""
    out = {name: drawn[name] - estimate[name] for name in QUANTITIES}
    out["phase_lag_deg"] = 180.0 - (180.0 - out["phase_lag_deg"]) % 360.0
    return out


def _repeated(states: States, draws: int) -> States:
    def often(values: Complex) -> Complex:
        return np.broadcast_to(values, (draws, *values.shape))

    return replace(
        states,
        force=often(states.force),
        drive_m=often(states.drive_m),
        drift=often(states.drift),
        deflection_m=often(states.deflection_m),
    )


def _systematic(
    states: States,
    backbone: Backbone,
    rows: tuple[int, ...],
    shapes: ModeShapes | None,
    model: ErrorModel,
    rng: np.random.Generator,
) -> States | None:
    """Return states with the errors that are common to all points; None if there are none."""
    calibration = model.per_channel("calibration_std", backbone)
    skew = np.radians(model.per_channel("phase_skew_std_deg", backbone))
    drawn = None if shapes is None else shapes.draw(model.draws, rng)
    shape, shape_std = states.drive_shape, backbone.drive_mode_shape_std
    uncertain = shapes is None and shape is not None and bool(shape_std)
    rounding = np.array([_rounding(point) for point in backbone.points])
    if not (calibration.any() or skew.any() or drawn is not None or uncertain or rounding.any()):
        return None
    count = len(backbone.channels)
    gain = 1.0 + calibration * rng.standard_normal((model.draws, count))
    angle = skew * rng.standard_normal((model.draws, count))
    wrong = _repeated(states, model.draws)
    if rounding.any():
        wrong = _rounded(wrong, backbone, rows, rounding, rng)
    delay = np.outer(states.frequency_hz / states.frequency_hz[0], np.arange(states.force.shape[-1]))

    def turned(row: int) -> Complex:
        return np.asarray(gain[:, row, None, None] * np.exp(1j * angle[:, row, None, None] * delay))

    force, drive = find_role(backbone.channels, "force"), find_role(backbone.channels, "drive")
    wrong = replace(wrong, force=wrong.force * turned(force), drive_m=wrong.drive_m * turned(drive))
    if rows:
        turns = np.stack([turned(row)[..., 1] for row in rows], axis=-1)
        wrong = replace(wrong, deflection_m=wrong.deflection_m * turns)
    if uncertain and shape is not None and shape_std is not None:
        relative = shape_std / np.abs(shape) * rng.standard_normal((model.draws, 1))
        wrong = replace(wrong, drive_shape=shape * np.exp(relative))  # of one sign, however uncertain
    if shapes is None or drawn is None:
        return wrong
    inverse = np.zeros((model.draws, drawn.shape[2], len(rows)))
    inverse[..., : drawn.shape[1]] = np.linalg.pinv(drawn)
    wrong = replace(wrong, inverse=inverse)
    same = states.linear_columns == tuple(range(drawn.shape[1]))
    if same and np.array_equal(states.linear_shape, shapes.tested):
        return replace(wrong, linear_shape=drawn[..., shapes.mode])
    return wrong


def _rounding(point: PeriodicVibration) -> Complex:
    return np.zeros(point.harmonics.shape, np.complex128) if point.rounding_std is None else point.rounding_std


def _rounded(
    wrong: States, backbone: Backbone, rows: tuple[int, ...], rounding: Complex, rng: np.random.Generator
) -> States:
    """Add the errors of rounding to ``wrong``, independent at each point; ``rounding`` is complex[n, n_channels, H + 1]."""
    points = backbone.points
    harmonics = np.array([point.harmonics for point in points])
    unit = np.divide(harmonics, np.abs(harmonics), out=np.ones_like(harmonics), where=harmonics != 0.0)
    size = (wrong.force.shape[0], *rounding.shape)
    errors = unit * (rounding.real * rng.standard_normal(size) + 1j * rounding.imag * rng.standard_normal(size))
    force, drive = find_role(backbone.channels, "force"), find_role(backbone.channels, "drive")
    deflection = wrong.deflection_m.copy()
    for column, row in enumerate(rows):
        deflection[..., column] += errors[:, :, row, 1] * _to_displacement(points, row)[:, 1]
    return replace(
        wrong,
        force=wrong.force + errors[:, :, force],
        drive_m=wrong.drive_m + errors[:, :, drive] * _to_displacement(points, drive),
        deflection_m=deflection,
    )


def _random(
    wrong: States, states: States, backbone: Backbone, rows: tuple[int, ...], rng: np.random.Generator
) -> States:
    """Add independent errors at each point to ``wrong``; the drive channel has the same errors wherever it appears."""
    draws, points = wrong.force.shape[0], backbone.points
    freedom = np.array([2 * (batches_of(point.periods) - 1) for point in points], dtype=float)

    def noise(row: int, harmonics: slice) -> Complex:
        std = np.array([_errors(point)[row, harmonics] for point in points])
        size = (draws, *std.shape)
        tails = np.sqrt(freedom[:, None] / rng.chisquare(np.broadcast_to(freedom[:, None], size)))
        return np.asarray(std * tails * (rng.standard_normal(size) + 1j * rng.standard_normal(size)))

    force, drive = find_role(backbone.channels, "force"), find_role(backbone.channels, "drive")
    drive_noise = noise(drive, slice(None)) * _to_displacement(points, drive)
    deflection = wrong.deflection_m.copy()
    for column, row in enumerate(rows):
        own = drive_noise if row == drive else noise(row, slice(1, 2)) * _to_displacement(points, row)[:, 1:2]
        deflection[..., column] += own[..., 1 if row == drive else 0]
    return replace(
        wrong,
        force=wrong.force + noise(force, slice(None)),
        drive_m=wrong.drive_m + drive_noise,
        deflection_m=deflection,
        drift=wrong.drift + _drift_noise(states, backbone, rng, draws),
    )


def _errors(point: PeriodicVibration) -> Float:
    """float[n_channels, H + 1]: standard errors without those of rounding, which are systematic."""
    if point.harmonics_std is None:
        return np.zeros(point.harmonics.shape)
    squares = point.harmonics_std**2 - part_of_each(_rounding(point)) ** 2
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


def _to_displacement(points: tuple[PeriodicVibration, ...], row: int) -> Complex:
    """complex[n, H + 1]: displacement per unit of the channel; 1 for harmonic 0, which is not used."""
    order = MOTION_ORDER[points[0].channels[row].motion]
    harmonic = np.maximum(np.arange(points[0].harmonics.shape[1]), 1)
    return np.asarray([(2j * np.pi * point.frequency_hz * harmonic) ** -order for point in points], dtype=np.complex128)


def _drift_noise(states: States, backbone: Backbone, rng: np.random.Generator, draws: int) -> Complex:
    """complex[draws, n]: random errors of the drift.

    The slope of a line over -1/2 ... 1/2 has twelve times the variance of its mean. In addition, the properties of a
    vibration that still drifts equal those of a steady one only to first order (joints with memory dissipate differently
    while they creep). Drift above the noise is therefore added to the standard error.
    """
    row = find_role(backbone.channels, "drive")
    relative = [
        0.0 if point.drift is None else _errors(point)[row, 1] / abs(point.harmonics[row, 1]) / point.periods
        for point in backbone.points
    ]
    noise = np.sqrt(12.0) * np.array(relative) * states.frequency_hz
    plain = np.sqrt(np.maximum(np.abs(states.drift) ** 2 - (_STANDS_OUT * noise) ** 2, 0.0))
    std = np.hypot(noise, plain)
    size = (draws, std.size)
    return np.asarray(std * (rng.standard_normal(size) + 1j * rng.standard_normal(size)))
