"""Reaction of an exciter to the motion of the drive point, approximated by a filter that runs along with a simulation.

The reaction is ``F = P Y``. If the output Y is the acceleration of the drive point, P contains ``1 / s^2``. This is exact for
frequency responses. In time, a double integrator would drift with any static component, and it would destabilise a model that
is inaccurate below the frequencies of its training. No causal filter is exact within a band and zero below it, because the
gain of a filter determines its phase (Bode 1945). The filter P^ chosen here is stable with the model and close to P. The
remainder P - P^ is added in passes over the whole run (`passes`). Each pass multiplies the error by

    (P - P^) G / (1 - P G),    G the model's linear part,

and the filter minimises this factor.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.exciter_coupling.kernels import Loop
from identification.linear.subspace import StateSpace
from vibrolock.arrays import Complex, Float

Response = Callable[[Float], Complex]

_LEAKS = (0.07, 0.15, 0.3, 0.6, 1.0, 2.0)
"""Poles of the filter that replace the integrators, relative to the lowest frequency."""
_DELAYS = 4
"""Delays in the filter, samples. Chosen: they stand for the poles that are too fast for it."""
_QUIET = (1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.3, 1.0)
"""Weights that are tried for the filter's gain below the band."""
_STATIC = 1e3
"""Weight of the filter's gain at zero frequency: there is no static force."""
_SLOW = 0.3
"""Share of the lowest frequency up to which the filter's gain should be small."""
_FAST = 2.5
"""Poles of the exciter faster than this, in radians per sample, are left to the delays."""
_TOP = 0.495
"""Highest frequency of the fit over the sample rate."""
_LINES = 600
"""Lines to which a filter is fitted. Chosen."""
_SHIFT = 0.15
"""Assumed relative shift of resonances with amplitude."""
_EASY, _LEAST = 0.05, 0.8
"""Factors of a pass. A filter with a factor below ``_EASY`` is always accepted; one with a factor above ``_LEAST`` never is."""


@dataclass(frozen=True)
class Reaction:
    """Exact reaction of an exciter to an output: the drive-point displacement, differentiated ``order`` times."""

    exciter: Exciter
    order: int
    lowest_hz: float
    sample_rate_hz: float

    def exact(self, frequency_hz: Float) -> Complex:
        """complex[n]: P, force per output, at frequencies above zero."""
        s = 2j * np.pi * frequency_hz
        return np.asarray(self.exciter.force(0.0, 1.0, frequency_hz) * s ** (2 - self.order))

    @property
    def poles(self) -> Complex:
        """Poles of P without its integrators, rad/s."""
        p, e = np.polynomial.polynomial, self.exciter
        coil, stinger = [1.0, e.coil_time_constant_s], [1.0, e.stinger_damping_time_s]
        mechanical = [e.suspension_stiffness_n_m, e.suspension_damping_n_s_m, e.moving_mass_kg]
        stiffness = p.polyadd(p.polymul(mechanical, coil), [0.0, e.back_emf_damping_n_s_m])
        whole = p.polyadd(p.polymul(coil, stinger), e.stinger_compliance_m_n * stiffness)
        return np.asarray(p.polyroots(np.trim_zeros(whole, "b")), dtype=np.complex128)

    def states(self) -> tuple[Float, Float]:
        """Return A and b of the filter: leaky integrators, the exciter's poles, delays."""
        leaks = np.exp(-2.0 * np.pi * self.lowest_hz * np.array(_LEAKS) / self.sample_rate_hz)
        blocks, inputs = [np.diag(leaks)], [1.0 - leaks]
        poles = self.poles / self.sample_rate_hz
        for z in np.exp(poles[(np.abs(poles) < _FAST) & (poles.imag >= 0.0) & (poles.real < 0.0)]):
            if z.imag:
                blocks.append(np.array([[z.real, z.imag], [-z.imag, z.real]]))
                inputs.append(np.array([1.0, 0.0]))
            else:
                blocks.append(np.array([[z.real]]))
                inputs.append(np.array([1.0 - z.real]))
        blocks.append(np.eye(_DELAYS, k=-1))
        inputs.append(np.eye(_DELAYS)[0])
        return np.asarray(scipy.linalg.block_diag(*blocks)), np.concatenate(inputs)

    def filters(self, linear: Response) -> list[Loop]:
        """Return filters that minimise the factor of a pass by least squares, in rising weight of small gain below the band."""
        a, b = self.states()
        band_hz = self.lines(_LINES)
        slow_hz = np.geomspace(0.03, 1.0, _LINES // 6) * _SLOW * self.lowest_hz
        exact = self.exact(band_hz)
        weight = self.sensitivity(band_hz, linear)
        inside = self._each(a, b, band_hz) * weight[:, None]
        below, still = (self._each(a, b, hz) * weight[0] for hz in (slow_hz, np.zeros(1)))
        right = np.concatenate([exact * weight, np.zeros(slow_hz.size + 1)])
        found = []
        for quiet in _QUIET:
            rows = np.concatenate([inside, quiet * below, _STATIC * still])
            left = np.concatenate([rows.real, rows.imag])
            scale = np.linalg.norm(left, axis=0)
            c = np.linalg.lstsq(left / scale, np.concatenate([right.real, right.imag]), rcond=1e-12)[0] / scale
            found.append(Loop(a, b, np.ascontiguousarray(c[:-1]), float(c[-1])))
        return found

    def sensitivity(self, lines_hz: Float, linear: Response) -> Float:
        """float[n]: ``|G / (1 - P G)|``, as the maximum over the range within which resonances shift with amplitude."""
        g = linear(lines_hz)
        reach = int(np.ceil(np.log1p(_SHIFT) / np.log(lines_hz[1] / lines_hz[0])))
        return np.asarray(
            scipy.ndimage.maximum_filter1d(np.abs(g / (1.0 - self.exact(lines_hz) * g)), 2 * reach + 1, mode="nearest")
        )

    def lines(self, count: int) -> Float:
        """Frequencies in Hz from the lowest frequency on, evenly spaced by logarithm."""
        return np.geomspace(self.lowest_hz, _TOP * self.sample_rate_hz, count)

    def response(self, loop: Loop, frequency_hz: Float) -> Complex:
        """complex[n]: frequency response P^ of a filter."""
        z = np.exp(2j * np.pi * frequency_hz / self.sample_rate_hz)
        filter_ = StateSpace(loop.a, loop.b[:, None], loop.c[None], np.array([[loop.d]]))
        return np.asarray(filter_.response(z)[:, 0, 0])

    def _each(self, a: Float, b: Float, frequency_hz: Float) -> Complex:
        """complex[n, n_xi + 1]: responses of the filter's states to the output, and 1 for its direct term."""
        z = np.exp(2j * np.pi * frequency_hz / self.sample_rate_hz)
        states = StateSpace(a, b[:, None], np.eye(len(b)), np.zeros((len(b), 1))).response(z)[:, :, 0]
        return np.column_stack([states, np.ones(z.size)])


def chosen_filter(reaction: Reaction, linear: StateSpace, row: int, output: int) -> Loop:
    """Choose a filter that is stable with the model's linear part and leaves little to the passes over the run.

    Among sufficient filters, the one with the smallest gain below the band is chosen. Raises `IdentificationError` if no
    filter is suitable.
    """

    def response(frequency_hz: Float) -> Complex:
        z = np.exp(2j * np.pi * frequency_hz / reaction.sample_rate_hz)
        return np.asarray(linear.response(z)[:, output, row])

    hz = reaction.lines(4 * _LINES)
    exact, sensitivity = reaction.exact(hz), reaction.sensitivity(hz, response)
    best, least = None, _LEAST
    for loop in reaction.filters(response):
        factor = float(np.max(np.abs(exact - reaction.response(loop, hz)) * sensitivity))
        if factor < max(least, _EASY) and _stable(loop, linear, row, output):
            best, least = loop, factor
    if best is None:
        raise IdentificationError(
            f"no filter for its reaction from {reaction.lowest_hz:.4g} Hz on is stable with the model and "
            "near to it; give another lowest_hz, or a model whose drive point is an acceleration",
            field="exciter",
        )
    return best


def _stable(loop: Loop, linear: StateSpace, row: int, output: int) -> bool:
    """Return whether the linear part with the reaction is no less stable than without it."""
    d = linear.d[output, row]
    through = 1.0 / (1.0 - loop.d * d)
    force = through * np.concatenate([loop.d * linear.c[output], loop.c])
    motion = np.concatenate([linear.c[output], np.zeros(loop.c.size)]) + d * force
    whole = scipy.linalg.block_diag(linear.a, loop.a)
    n = len(linear.a)
    whole[:n] += np.outer(linear.b[:, row], force)
    whole[n:] += np.outer(loop.b, motion)
    alone = float(np.max(np.abs(np.linalg.eigvals(linear.a))))
    return bool(through > 0.0 and np.max(np.abs(np.linalg.eigvals(whole))) < max(1.0, alone))
