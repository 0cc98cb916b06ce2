"""Stability, margins and poles of a linearised loop with delay, without approximating the delay.

Closed-loop poles are zeros of ``det(I + K M)``, which is analytic except at the known poles of plant, low-pass and integrators.
The poles are counted on a contour by the argument principle, and found by Newton's method from a grid. The region is the half
disc of radius 0.8 W. Further out, the map is dominated by the exciter's response near zero frequency, and averaging over a
period has no meaning. A loop whose gain is high enough for poles there is recognised by its gain at W/2 (`gains_at_half`).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from controller.tuning.laws import ComplexResponseLaw
from controller.tuning.loop import ControlLoop, SlowChanges, slow_changes
from controller.tuning.plant import PlantModel
from vibrolock.arrays import Complex, Float

REACH = 0.8  # of W: radius within which poles are searched
HALF = 0.5  # of W: changes within two periods, the fastest that an average over one period can follow
LARGEST_AT_HALF = 2.2
"""Largest allowed loop gain at W/2. Up to this gain, growing poles stay within the searched radius, even if the loop gain
falls steeply with frequency. The value is above 1 because the paper's force loop, off resonance, crosses over at 0.5 to 1 W and
is stable."""
INSET = 2e-4  # of W: closer to the imaginary axis than this, a pole counts as marginal, not as unstable


@dataclass(frozen=True)
class Margins:
    """How far a loop is from instability."""

    sensitivity_peak: float
    """max |S|, S = 1/(1 + L)."""
    gain_margin: float
    """Smallest factor above 1 on the gains that makes the loop unstable; infinite if there is none."""
    phase_margin_deg: float
    """Smallest additional phase, of either sign, that makes the loop unstable; 180 if there is none."""
    crossover_rad_s: float
    """Highest frequency with |L| = 1; 0 if there is none."""


def unstable_poles(loop: ControlLoop) -> int:
    """Return the number of closed-loop poles in the right half plane, by the argument principle.

    A rig without control is stable. A growing pole of the plant's model beyond the band of its fit belongs to the fit alone: it
    is not counted, for the loop of the rig is closed on what was measured. A loop whose gain there is so high that the model's
    pole moves counts as unstable.
    """
    omega = loop.omega_rad_s
    radius = REACH * omega
    poles = loop.plant.poles_rad_s
    offsets = poles - 1j * omega
    lowest, highest = (2.0 * math.pi * hertz for hertz in loop.plant.band_hz)
    measured = (poles.imag >= lowest) & (poles.imag <= highest)
    known = 2 * int(np.sum(measured & (offsets.real > INSET * omega) & (np.abs(offsets) < radius)))
    return abs(_windings(loop.determinant, INSET * omega, radius) + known)


def changes_of_hardening(plant: PlantModel, lag_deg: float = -90.0) -> SlowChanges:
    """Return what a plant makes of slow changes, for `hardening_margins` of several laws on it."""
    omega = plant.lock_frequency_rad_s(lag_deg)
    return slow_changes(plant, np.asarray(1j * np.geomspace(1e-4, REACH, 600) * omega, np.complex128), omega)


def hardening_margins(loop: ControlLoop, known: SlowChanges | None = None) -> tuple[float, float]:
    """Return the softening and the hardening (both from 0) up to which a loop that is stable on the linear plant stays stable.

    Both are changes of the mode's frequency for a relative change of its amplitude, ``d ln w_0 / d ln a``: a hardening kappa
    closes the loop ``1 - kappa t(s)`` around t, the transfer function from a shift of the mode to its amplitude. It becomes
    unstable at the first kappa for which ``kappa t(i w)`` is 1. Infinite if there is none. ``known``: `changes_of_hardening` of
    the loop's plant and lag.
    """
    known = known or changes_of_hardening(loop.plant, loop.lag_deg)
    transfer = loop.response_after_shift(known.s, known) * loop.plant.frequency_rad_s
    across = np.flatnonzero(np.diff(np.sign(transfer.imag)) != 0)
    share = transfer.imag[across] / (transfer.imag[across] - transfer.imag[across + 1])
    real = transfer.real[across] + share * (transfer.real[across + 1] - transfer.real[across])
    real = np.append(real, transfer.real[0])  # standing still
    return _first_slope(-real), _first_slope(real)


def _first_slope(real: Float) -> float:
    """Return the smallest kappa above 0 for which kappa times one of the values is 1; infinite if there is none."""
    most = float(np.max(real, initial=0.0))
    return 1.0 / most if most > 0.0 else math.inf


def gains_at_half(loop: ControlLoop) -> dict[str, float]:
    """Return the largest gain of each loop on the half circle of radius W/2 in the right half plane.

    For each loop the outer loops are open; the force loop is taken with the response loop closed. The gain is linear in the
    gains of the law. A pole can leave the half disc only if the gain exceeds 1, and a pole that has left is not found.
    Therefore a loop above `LARGEST_AT_HALF` counts as unusable, whatever the number of poles.
    """
    angle = np.linspace(-0.5 * math.pi, 0.5 * math.pi, 101)
    s = HALF * loop.omega_rad_s * np.exp(1j * angle)
    out = {"frequency loop": (loop.feedback(s) @ loop.measured(s))[:, 2, 2]}
    law = loop.amplitude_law
    if isinstance(law, ComplexResponseLaw):
        inner = replace(loop, amplitude_law=replace(law, force_per_s=0.0))
        out["response loop"] = inner.amplitude_loop_gain(s)
        if law.force_per_s > 0.0:
            both, alone = (np.linalg.det(some.return_difference(s)[:, :2, :2]) for some in (loop, inner))
            out["force loop"] = both / alone - 1.0
    elif law is not None:
        out["amplitude loop"] = loop.amplitude_loop_gain(s)
    return {name: float(np.abs(gain).max()) for name, gain in out.items()}


def _windings(function: Callable[[Complex], Complex], inset: float, radius: float) -> int:
    """Return how often a function's value winds around 0 along the half disc's border, counter-clockwise."""
    corner = math.acos(inset / radius)
    height = radius * math.sin(corner)
    slow = np.geomspace(inset, height, 400)
    line = inset + 1j * np.concatenate([slow[::-1], [0.0], -slow])
    arc = radius * np.exp(1j * np.linspace(-corner, corner, 200))
    s = np.concatenate([line, arc[1:]])
    values = function(s)
    for _ in range(30):
        turns = np.angle(values[1:] / values[:-1])
        coarse = np.flatnonzero(np.abs(turns) > 0.5)
        if coarse.size == 0:
            break
        middle = 0.5 * (s[coarse] + s[coarse + 1])
        s, values = np.insert(s, coarse + 1, middle), np.insert(values, coarse + 1, function(middle))
    return round(float(np.sum(np.angle(values[1:] / values[:-1]))) / (2.0 * math.pi))


def closed_loop_poles(loop: ControlLoop) -> Complex:
    """Return the poles of the closed loop (1/s) within 0.8 W of the origin, sorted by modulus [n]; W is the locked frequency.

    A multiple pole is listed once.
    """
    omega = loop.omega_rad_s
    offsets = loop.plant.poles_rad_s - 1j * omega
    near = offsets[np.abs(offsets) < omega]
    known = np.concatenate([near, near.conj(), np.full(3, -loop.low_pass_rad_s), np.zeros(3)])
    scale = loop.low_pass_rad_s

    def function(s: Complex) -> Complex:
        return np.asarray(loop.determinant(s) * np.prod((s[:, None] - known) / scale, axis=1))

    reach = REACH * omega
    grid = np.concatenate([-np.geomspace(1e-3, 1.0, 14) * reach, np.geomspace(1e-2, 1.0, 5) * reach])
    height = np.concatenate([[0.01], np.linspace(0.05, 1.0, 14)]) * reach
    start = (grid[:, None] + 1j * height).ravel()
    s, _ = _newton(function, start, 40, 0.1 * reach, 1e-6 * omega)
    # A known pole that the determinant does not have appears here as a false zero; Newton steps on the determinant then grow.
    final, first = _newton(loop.determinant, s, 1, 0.1 * reach, 1e-6 * omega)
    final, last = _newton(loop.determinant, final, 4, 0.1 * reach, 1e-6 * omega)
    closing = np.abs(last) < np.maximum(0.7 * np.abs(first), 1e-8 * omega)
    good = np.isfinite(final) & (np.abs(final) < reach) & closing & (np.abs(final - s) < 1e-3 * omega)
    return _distinct(final[good], known, 1e-3 * omega)


def _newton(
    function: Callable[[Complex], Complex], s: Complex, steps: int, longest: float, width: float
) -> tuple[Complex, Complex]:
    """Take Newton steps from the points s [n]; return the final points and the last steps.

    The derivative comes from central differences over +-``width``; no step is longer than ``longest``.
    """
    change = np.zeros_like(s)
    with np.errstate(all="ignore"):
        for _ in range(steps):
            above, below, here = function(np.concatenate([s + width, s - width, s])).reshape(3, -1)
            change = here * (2.0 * width) / (above - below)
            change = change * np.minimum(1.0, longest / np.abs(change))
            s = np.where(np.isfinite(change), s - change, s)
    return s, change


def _distinct(found: Complex, known: Complex, apart: float) -> Complex:
    """Return one pole of each cluster, with conjugates, without those that coincide with a known open-loop pole."""
    found = np.concatenate([found, found.conj()])
    out: list[complex] = []
    for pole in found[np.argsort(-found.real)]:
        if all(abs(pole - other) > apart for other in out) and np.min(np.abs(pole - known)) > 1e-6 * apart:
            out.append(complex(pole))
    return np.array(sorted(out, key=lambda pole: (abs(pole), pole.imag)), np.complex128)


def margins(omega: Float, loop_gain: Complex) -> Margins:
    """Return the margins of a stable loop from L(i omega) [n] at rising frequencies; of both signs if L is complex."""
    sensitivity = 1.0 / np.abs(1.0 + loop_gain)
    size, angle = np.abs(loop_gain), np.angle(-loop_gain)
    across = np.flatnonzero(
        (np.diff(np.sign(angle)) != 0) & (np.abs(np.diff(angle)) < math.pi) & (omega[1:] * omega[:-1] > 0.0)
    )
    share = angle[across] / (angle[across] - angle[across + 1])
    sizes = size[across] + share * (size[across + 1] - size[across])
    gains = 1.0 / sizes[sizes < 1.0]
    one = np.flatnonzero((np.diff(np.sign(size - 1.0)) != 0) & (omega[1:] * omega[:-1] > 0.0))
    part = (1.0 - size[one]) / (size[one + 1] - size[one])
    unit = loop_gain[one] + part * (loop_gain[one + 1] - loop_gain[one])
    return Margins(
        sensitivity_peak=float(sensitivity.max()),
        gain_margin=float(gains.min(initial=math.inf)),
        phase_margin_deg=float(np.degrees(np.abs(np.angle(-unit)).min(initial=math.pi))),
        crossover_rad_s=float(np.abs(omega[one]).max(initial=0.0)),
    )
