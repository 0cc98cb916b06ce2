"""Harmonic balance of the coupled rig including coil, armature and stinger: an independent reference for tests.

The rig is driven by the sinusoidal voltage ``u = U cos(theta)`` in continuous time; the voltage has more harmonics where those
of the stinger force are controlled (`simulators.analysis.force_control`). The linear part is solved exactly per
harmonic. The nonlinear sites are evaluated by alternating frequency-time (Cameron & Griffin 1989) with ``samples`` per period.
Friction is integrated over two periods from the virgin state, and the second period is used. If a site leaves the range in
which its law holds, the point is flagged. For a rig with scatter the nominal specimen is analysed; ``rig.realised(seed)`` is
the specimen of one run.

Phase lags are those of the drive point's acceleration behind the stinger force (fundamentals); -90 deg is phase resonance.
"""

from typing import Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simulators.analysis.conditions import Conditions, Quantity, held_force, lags_rad, levels, positive
from simulators.analysis.paths import BalanceOptions, ModePaths
from simulators.analysis.responses import PeriodicResponses
from simulators.virtual_rig import VirtualRig
from vibrolock.errors import InputError

RESONANCE_DEG = -90.0  # deg; lag of the acceleration behind the force at phase resonance, by definition
_FROM_BELOW_TO_ABOVE = (-175.0, -5.0)  # deg; first and last lag of a whole curve; chosen
_LAGS = 86  # lags of a whole curve, 2 deg apart; chosen


def phase_resonance_backbone(
    rig: VirtualRig,
    *,
    forces_n: ArrayLike | None = None,
    voltages_v: ArrayLike | None = None,
    amplitudes_m: ArrayLike | None = None,
    quantity: Quantity = "fundamental",
    phase_lag_deg: float = RESONANCE_DEG,
    excitation: Literal["exciter", "pure-sine"] = "exciter",
    **options: Unpack[BalanceOptions],
) -> PeriodicResponses:
    """Compute the vibration at phase resonance, or at another lag, for each level; each level continues from the previous one.

    Raises `ValueError` on values that are not allowed, by name. Raises `NotConvergedError` if a level cannot be
    reached; the message names the level, and ``found`` holds the points before it.

    Parameters
    ----------
    rig
        The virtual rig.
    forces_n, voltages_v, amplitudes_m
        Levels, one of the three: stinger force (N), amplitude of the voltage (V), or peak of the fundamental of the
        drive point's displacement (m).
    quantity
        What ``forces_n`` are: peaks of the ``fundamental``, or ``rms`` values of all harmonics from the first on.
    phase_lag_deg
        Lag held, -179 to -1.
    excitation
        ``exciter``: the coupled rig under a pure voltage, whose force has harmonics. ``pure-sine``: the structure alone
        under a sinusoidal force at the drive point, given by ``forces_n``; the result does not depend on an exciter.
    force_harmonics
        Harmonics of the stinger force that are controlled. A number, such as 7: harmonics 2 to 7 are zero. A table, such as
        ``{2: 0.1j, 3: 0.0}``: each harmonic h has its value ``c_h = F_h / (|F_1| exp(i h arg F_1))``, the amplitude relative to
        the fundamental and the phase where the fundamental is at its maximum. The voltage has the same harmonics (the
        result's ``voltage_harmonics_v``). The static force of the suspension and all other harmonics of the force are
        those of the coupled rig. Default: the voltage is a sine.
    near_hz
        The linear mode of the structure nearest to this frequency is followed. Default: the lowest that moves a
        nonlinear site.
    harmonics, samples
        Highest harmonic, and samples per period (at least four per harmonic). ``neglected_share`` of the result tells how much
        the higher harmonics contribute; increase ``harmonics`` if that is too much.
    """
    held, values = levels(forces_n, voltages_v, amplitudes_m)
    InputError.unless_one_of("excitation", excitation, ("exciter", "pure-sine"))
    held_as = held_force(quantity)
    if excitation == "pure-sine" and held == "voltage":
        raise InputError("allowed with excitation = 'exciter', a pure sine has forces_n", field="voltages_v")
    if excitation == "pure-sine" and options.get("force_harmonics") is not None:
        raise InputError(field="force_harmonics", allowed="with excitation = 'exciter', a pure sine has none")
    lag = float(lags_rad("phase_lag_deg", [phase_lag_deg])[0])
    paths = ModePaths.of(rig, **options, pure_sine=excitation == "pure-sine")
    goals = [Conditions(held_as if held == "force" else held, float(level), "lag", lag) for level in values]
    return paths.evaluation(paths.path(goals))


def constant_force_response(
    rig: VirtualRig,
    force_n: float,
    phase_lags_deg: ArrayLike | None = None,
    *,
    quantity: Quantity = "fundamental",
    **options: Unpack[BalanceOptions],
) -> PeriodicResponses:
    """Compute the frequency response at constant force, from below to above resonance, including the unstable branch.

    The phase lag is the path parameter. It grows along the whole curve, so that folds of the frequency need no arc-length
    continuation. ``stable`` marks the branches that a test with constant force and slowly swept frequency can hold; the branch
    between the folds, where the frequency falls, is unstable. This is the static stability of the fundamental. Bifurcations to
    other periods and the stability of a control loop are not examined.

    Raises `ValueError` on values that are not allowed, by name. Raises `NotConvergedError` if the force cannot be
    reached or the path ends; the message says where. ``found`` holds the points found.

    Parameters
    ----------
    rig
        The virtual rig.
    force_n
        Stinger force that is held.
    phase_lags_deg
        Lags, -179 to -1, rising. Default: 86 from -175 to -5, both ends far off resonance.
    quantity
        Meaning of ``force_n``: the peak of the ``fundamental``, or the ``rms`` of all harmonics from the first on, without the
        mean, which piezoelectric sensors do not measure.
    force_harmonics, near_hz, harmonics, samples
        As for `phase_resonance_backbone`.
    """
    force, held = float(positive("force_n", [force_n])[0]), held_force(quantity)
    lags = _lags(phase_lags_deg)
    paths = ModePaths.of(rig, **options)
    return paths.over_lags([Conditions(held, force, "lag", float(lag)) for lag in lags])


def constant_displacement_response(
    rig: VirtualRig,
    amplitude_m: float,
    phase_lags_deg: ArrayLike | None = None,
    *,
    frequencies_hz: ArrayLike | None = None,
    **options: Unpack[BalanceOptions],
) -> PeriodicResponses:
    """Compute vibrations at constant displacement amplitude of the drive point, as in a response-controlled stepped test.

    Raises `ValueError` on values that are not allowed, by name. Raises `NotConvergedError` if the amplitude cannot be
    reached; the message says where. ``found`` holds the points found before.

    Parameters
    ----------
    rig
        The virtual rig.
    amplitude_m
        Peak of the fundamental of the drive point's displacement, held.
    phase_lags_deg
        Lags, -179 to -1, rising. Default, without frequencies: 86 from -175 to -5.
    frequencies_hz
        Frequencies [n] instead of lags, in any order; the first point is approached from rest at its frequency.
    force_harmonics, near_hz, harmonics, samples
        As for `phase_resonance_backbone`.
    """
    amplitude = float(positive("amplitude_m", [amplitude_m])[0])
    if phase_lags_deg is not None and frequencies_hz is not None:
        raise InputError("both given", field="phase_lags_deg, frequencies_hz", allowed="one of them")
    paths = ModePaths.of(rig, **options)
    if frequencies_hz is not None:
        omega = 2.0 * np.pi * positive("frequencies_hz", frequencies_hz)
        goals = [Conditions("response", amplitude, "frequency", float(w)) for w in omega]
        return paths.evaluation(paths.path(goals))
    return paths.over_lags([Conditions("response", amplitude, "lag", float(lag)) for lag in _lags(phase_lags_deg)])


def forced_response(
    rig: VirtualRig, voltage_v: float, frequencies_hz: ArrayLike, **options: Unpack[BalanceOptions]
) -> PeriodicResponses:
    """Compute the response to a constant voltage at each frequency, as in a slow sweep without control in this order.

    Each point continues from the previous one. Where the branch ends and a sweep would jump, the point is reached from rest at
    its frequency.

    Raises `ValueError` on values that are not allowed, by name. Raises `NotConvergedError` if no vibration is found at
    a frequency; the message names it, and ``found`` holds the points before it.

    Parameters
    ----------
    rig
        The virtual rig.
    voltage_v
        Amplitude of the voltage.
    frequencies_hz
        Frequencies [n], in the order of the sweep.
    force_harmonics, near_hz, harmonics, samples
        As for `phase_resonance_backbone`.
    """
    voltage = float(positive("voltage_v", [voltage_v])[0])
    omega = 2.0 * np.pi * positive("frequencies_hz", frequencies_hz)
    paths = ModePaths.of(rig, **options)
    return paths.evaluation(paths.path([Conditions("voltage", voltage, "frequency", float(w)) for w in omega]))


def _lags(phase_lags_deg: ArrayLike | None) -> NDArray[np.float64]:
    """Return rising lags in radians; by default lags over the whole curve."""
    asked = np.linspace(*_FROM_BELOW_TO_ABOVE, _LAGS) if phase_lags_deg is None else phase_lags_deg
    return lags_rad("phase_lags_deg", asked, rising=True)
