"""Predict sweeps through the resonance of a nonlinear mode by slow flow, with imposed force or with coupled exciter.

Near resonance the complex modal amplitude Q, relative to the phase theta of the sweep (``W = theta'``, ``s = i W``), obeys

    D(s + d/dt) Q = phi N(s + d/dt) u,    D(s) = s^2 + 2 z w s + w^2 + phi^2 L(s),

with w and z at ``|Q|``. With imposed force (founding paper, slow-flow equations) u is the force, N = 1 and L = 0. With
coupled exciter u is the voltage; from ``X_a = phi Q + r F`` and ``F = g_e V - Z X_a`` follow

    N = g_e / (1 + Z r),    L = Z / (1 + Z r),    F = N V - L phi Q,

where r is the receptance of the other modes plus the compliance of the stinger.

Slow flow. D has a root lambda near s, ``D = (s - lambda) G(s)`` with smooth G, so that ``(d/dt + s - lambda) Q`` equals
``phi N/G`` applied to the input. For a linear system this is exact for any theta, including transients. The neglected terms
are of the order of ``(N/G)'' W'``. One step of Halley's method gives ``s - lambda = D / G`` with ``G = D' - D D'' / (2 D')``,
and an expansion of N/G to first order gives

    Q' = [phi (N u + N' u' - D''/(2 G) N u') - D Q] / G.

The equation of the founding paper is the same with ``G = 2 i W`` and without u'.
"""

from typing import Literal

import numpy as np

from identification.errors import ExtrapolationError, IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.linear.modes import LinearModes
from identification.models.modal.kernels import DIVERGED, modal_rate, slow_flow
from identification.models.modal.properties import HIGHER_LEVELS, REFUSED_BEYOND, ModalProperties
from identification.models.modal.sweep_inputs import SweepInput, VoltageSweep, force_input, voltage_input
from identification.models.modal.sweep_prediction import SweepPrediction
from identification.nonlinear.nonlinear_modes import NonlinearMode
from identification.prediction.steady_prediction import FLAGGED_BEYOND
from identification.renamed import formerly
from identification.signals.half_periods import HalfPeriods
from identification.signals.transients import Transient
from identification.validation import one_specimen
from vibrolock.arrays import Complex, Float

_Tables = tuple[Float, Float, Float, Float, Float]

_TABLE_SIZE = 1024  # frequencies at which exciter and other modes are tabulated; chosen
_UNBOUNDED = 1e3
"""Use of the identified range at which the integration ends if any extrapolation is allowed. Chosen."""
_AT_REST = 1e-3  # first drive over the largest, up to which the sweep starts from rest; chosen
_SETTLED = 12.0
"""Time constants after which a motion counts as settled. Chosen: e^-12 is 6e-6."""
_STEP_RAD = 0.4  # rotation of the amplitude relative to its steady state within one Runge-Kutta step
_LEAST_DECAY = 1e-4  # lower bound of the decay rate over the detuning, which bounds the steps of settling; chosen


@formerly
def predict_sweep(
    mode: NonlinearMode | ModalProperties,
    sweep: Transient | HalfPeriods | VoltageSweep,
    *,
    exciter: Exciter | None = None,
    linear_modes: LinearModes | None = None,
    voltage: str = "voltage",
    damping: Literal["fundamental", "total-power"] = "fundamental",
    largest_range_use: float = REFUSED_BEYOND,
) -> SweepPrediction:
    """Predict the response of one nonlinear mode to a sweep.

    Raises `ExtrapolationError` if the modal amplitude exceeds ``largest_range_use`` times the largest identified one, and
    `IdentificationError` if input and exciter do not match.

    Parameters
    ----------
    mode
        Identified mode, or its properties over the modal amplitude, which then determine ``damping`` and
        ``largest_range_use``.
    sweep
        Without ``exciter``, the recorded force is imposed: its fundamentals (`Transient`) or its (half) periods. With
        ``exciter``, the voltage is imposed: that of a recording (`Transient`) or of a planned `VoltageSweep`.
    exciter
        Exciter identified on the same rig.
    linear_modes
        Linear modes of the structure; all but the tested one contribute by their receptance. For a suspended or otherwise
        soft structure their contribution is several percent.
    voltage
        Name of the voltage channel.
    damping
        Damping ratio to use, see `ModalProperties.of`.
    largest_range_use
        Largest modal amplitude over the largest identified; ``inf`` allows any.

    Returns
    -------
    SweepPrediction
        Prediction from the first instant of the input, in the steady state there.
    """
    properties = mode
    if isinstance(mode, NonlinearMode):
        one_specimen(mode=mode.specimen, modes="" if linear_modes is None else linear_modes.specimen)
        properties = ModalProperties.of(mode, damping=damping, largest_range_use=largest_range_use)
    assert isinstance(properties, ModalProperties)
    if exciter is None:
        if isinstance(sweep, VoltageSweep):
            raise IdentificationError("is a voltage", field="sweep", allowed="an exciter", hint="give exciter")
        given = force_input(sweep)
        force, load = given.amplitude, np.zeros((given.time_s.size, 3), np.complex128)
        rate = np.gradient(force, given.step_s) if given.window_periods else np.zeros_like(force)
        return _integrate(properties, given, force, rate, load, None, ())
    if isinstance(sweep, HalfPeriods):
        raise IdentificationError(
            "half periods of a force are imposed without an exciter; give exciter = None", field="sweep"
        )
    given = voltage_input(sweep, voltage)
    detuning = np.max(np.abs(2.0 * np.pi * given.frequency_hz - properties.omega_rad_s[0]))
    given = given.thinned(0.5 * _STEP_RAD / float(max(detuning, 1e-9)))
    notes = _coupling_notes(exciter, linear_modes, given)
    return _integrate(properties, given, *_coupled(given, exciter, linear_modes, properties), notes)


def _coupled(
    given: SweepInput, exciter: Exciter, modes: LinearModes | None, properties: ModalProperties
) -> tuple[Complex, Complex, Complex, Complex]:
    """``N V + N' V'`` and ``N V'`` (complex[n]), the load L (complex[n, 3]), and r of the other modes (complex[n, 2]).

    All are smooth functions of frequency. They and their derivatives with respect to s are interpolated linearly in a fine
    table.
    """
    low, high = float(given.frequency_hz.min()), float(given.frequency_hz.max())
    table_hz = np.linspace(low * (1.0 - 1e-6), high * (1.0 + 1e-6), _TABLE_SIZE)
    s = 2j * np.pi * table_hz
    others = np.zeros(_TABLE_SIZE, np.complex128)
    if modes is not None:
        tested = modes.nearest(float(properties.frequency_rad_s(properties.q_range[0])) / (2.0 * np.pi))
        others = modes.receptance(table_hz, without=tested)
    stiffness = exciter.dynamic_stiffness(s)
    shared = 1.0 + stiffness * (others + exciter.stinger_compliance(s))
    per_volt = exciter.force_per_volt(s) * exciter.path.factor(table_hz) / shared
    value = np.column_stack([per_volt, stiffness / shared, others])
    slope = np.gradient(value, s, axis=0, edge_order=2)
    curvature = np.gradient(slope[:, 1], s, edge_order=2)
    table = np.column_stack([value, slope, curvature])
    place = (given.frequency_hz - table_hz[0]) / (table_hz[1] - table_hz[0])
    row = place.astype(np.int64)
    found = table[row] + (place - row)[:, None] * np.diff(table, axis=0)[row]
    rate = np.gradient(given.amplitude, given.step_s)
    drive = found[:, 0] * given.amplitude + found[:, 3] * rate
    return drive, found[:, 0] * rate, found[:, [1, 4, 6]], found[:, [2, 5]]


def _integrate(
    properties: ModalProperties,
    given: SweepInput,
    drive: Complex,
    change: Complex,
    load: Complex,
    others: Complex | None,
    notes: tuple[str, ...],
) -> SweepPrediction:
    p = properties
    kept = slice(0, 2 * ((given.time_s.size - 1) // 2) + 1)
    s = 2j * np.pi * given.frequency_hz[kept]
    out, rate = np.empty(((s.size + 1) // 2,), np.complex128), np.empty(((s.size + 1) // 2,), np.complex128)
    largest = p.q_range[1] * min(p.largest_range_use, _UNBOUNDED)
    tables: _Tables = (
        p.modal_amplitude,
        p.omega_coefficients,
        p.damping_coefficients,
        p.drive_shape_coefficients,
        p.tail,
    )
    step = 2.0 * given.step_s
    start = 0j
    if abs(drive[0]) > _AT_REST * np.max(np.abs(drive)):
        start = _settled(p, complex(s[0]), complex(drive[0]), load[0], tables)
    code, count = slow_flow(start, step, s, drive, change, load, *tables, largest, out, rate)
    every = slice(0, 2 * count - 1, 2)
    if code == DIVERGED:
        where = f"at {given.time_s[every][-1]:.4g} s, {given.frequency_hz[every][-1]:.4g} Hz"
        if p.largest_range_use < _UNBOUNDED:
            raise ExtrapolationError(
                f"modal amplitude: exceeds {p.largest_range_use:g} times the largest identified ({p.q_range[1]:.4g} kg^1/2 m) "
                f"{where}; {HIGHER_LEVELS}"
            )
        notes += (f"the amplitude is unbounded: the prediction ends {where}",)
    amplitude, rate = out[:count], rate[:count]
    range_use = float(np.max(np.abs(amplitude)) / p.q_range[1])
    if range_use > FLAGGED_BEYOND:
        notes += (f"reaches {range_use:.2f} times the largest modal amplitude identified",)
    drive, load, s, phi = drive[every], load[every], s[every], p.drive_shape(np.abs(amplitude))
    # F = N - phi (L Q + L' Q'), X_d = phi Q + r F + r' F', velocity (s + d/dt) X_d
    force = drive - phi * (load[:, 0] * amplitude + load[:, 1] * rate)
    drive_m = phi * amplitude
    if others is not None:
        drive_m = drive_m + others[every, 0] * force + others[every, 1] * _rate(force, step)
    drive_m_s = s * drive_m + _rate(drive_m, step)
    return SweepPrediction(
        time_s=given.time_s[every],
        frequency_hz=given.frequency_hz[every],
        modal_amplitude=amplitude,
        drive_m=drive_m,
        drive_m_s=drive_m_s,
        drive_m_s2=s * drive_m_s + _rate(drive_m_s, step),
        force=force,
        largest_identified=p.q_range[1],
        window_periods=given.window_periods,
        origin=given.origin,
        notes=notes,
    )


def _rate(values: Complex, step_s: float) -> Complex:
    return np.gradient(values, step_s) if values.size > 1 else np.zeros_like(values)


def _settled(p: ModalProperties, s: complex, drive: complex, load: Complex, tables: _Tables) -> complex:
    """Return the steady amplitude under a constant input, integrated from rest with a step set by the detuning."""
    small = 1e-3 * p.q_range[0]
    detuning = -modal_rate(small + 0j, s, 0j, 0j, load, *tables) / small
    step_s = _STEP_RAD / abs(detuning)
    steps = int(np.ceil(_SETTLED / (max(detuning.real, _LEAST_DECAY * abs(detuning)) * step_s))) + 1
    size = 2 * steps - 1
    out, rate = np.empty(steps, np.complex128), np.empty(steps, np.complex128)
    still, loads = np.zeros(size, np.complex128), np.broadcast_to(load, (size, 3)).copy()
    held = (np.full(size, s), np.full(size, drive), still, loads)
    _, count = slow_flow(0j, step_s, *held, *tables, p.q_range[1] * _UNBOUNDED, out, rate)
    return complex(out[count - 1])


def _coupling_notes(exciter: Exciter, modes: LinearModes | None, given: SweepInput) -> tuple[str, ...]:
    notes = [f"holds for the exciter of {exciter.source} alone" if exciter.source else "holds for this exciter alone"]
    if modes is None:
        notes.append("the structure's other modes are left out")
        return tuple(notes)
    low, high = given.frequency_hz.min(), given.frequency_hz.max()
    if np.count_nonzero((modes.frequency_hz > low) & (modes.frequency_hz < high)) > 1:
        notes.append("more than one mode lies in the sweep's range: only the tested one is nonlinear")
    return tuple(notes)
