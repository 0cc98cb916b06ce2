"""The linear rig near one mode in physical parameters, fitted to measured responses together with what is known beforehand.

The structure has the mode under test, modes beside it where the responses show them, and one mode far below and one far above
for what the others contribute. Shaker, amplifier and stinger are those of `identification.Exciter`::

    (1 + Z r) F = g_e V - Z A / s^2,    Z = s^2 m + s c + k + s b / (1 + s tau),    g_e = g / (1 + s tau),    r = 1 / k_s.

The voltage is the number given to a converter that holds it, the inputs pass an AC coupling, as in
`identification.VoltagePath`. Suspension damping c and back-EMF b are told apart by the coil alone, so they
are one parameter here, half of it each.

Every parameter has a prior, wide for what nobody knows; it bounds the directions that the data do not determine. Masses,
stiffnesses and all else that is positive are fitted and drawn by their logarithms, within `POSSIBLE` of the prior: no step of a
fit leads to a stiffness of 0 or an infinite mass. With the
Jacobian J of the residuals over their standard deviations, prior included, the covariance is ``s^2 (J^T J)^-1`` (Tarantola,
Inverse Problem Theory, SIAM 2005, section 3.2), where s^2 is the misfit over its expectation if that is above 1.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rig.errors import ConfigurationError
from vibrolock.arrays import Complex, Float

LOW, HIGH, FLOOR_DAMPING = 0.05, 2.0, 0.005  # frequencies of the far modes over the ends of the band; their damping
ABOVE = 1.1  # of the end of the band: least frequency of the mode above it
UNEXPLAINED = 4.0  # misfit over its expectation above which a further mode is looked for
EXPLAINED = 0.5  # of that misfit must be left, or less, for the mode to be kept
MOST_BESIDE = 3
MOST_CORRECTIONS = 20
MODEL_FLOOR = 2e-3  # of a response: smallest standard deviation that is believed
EXCITER = (
    "force_per_volt_n_v",
    "coil_time_constant_s",
    "moving_mass_kg",
    "exciter_damping_n_s_m",
    "suspension_stiffness_n_m",
    "stinger_stiffness_n_m",
)
MODE = ("frequency_hz", "damping_ratio", "drive_shape")
COUPLING_HZ = 0.3  # AC coupling of common conditioners
POSSIBLE = 12.0  # distance of a logarithm from its prior that a fit never leaves: a factor of 160 000 either way
WIDE = 0.7  # standard deviation of the logarithm of what nobody has measured: a factor of two either way


@dataclass(frozen=True)
class Prior:
    """What is known of a parameter: its value and the standard deviation of its logarithm."""

    value: float
    log_std: float


@dataclass(frozen=True, eq=False)
class Responses:
    """Measured responses to the voltage."""

    frequency_hz: Float
    """Lines [n]."""
    value: Complex
    """Force (N/V), acceleration of the drive point and of every response channel (m/s^2/V) [n, 2 + responses]."""
    std: Float
    """Standard deviations [n, 2 + responses]."""
    sample_rate_hz: float
    """Sample rate of the hold of the output; the voltage is the number given to the converter."""


@dataclass(frozen=True, eq=False)
class LinearRig:
    """One linear rig: parameters by name."""

    values: Mapping[str, float]
    """Parameters. Modes beside the tested one have their number behind the name, the far ones ``low`` and ``high``."""
    channels: tuple[str, ...]
    """Response channels; the shape of mode ``x`` at a channel over that at the drive point is ``ratio <channel> x``."""

    @property
    def modes(self) -> tuple[str, ...]:
        """Ends of the names of the modes; that of the tested mode is empty."""
        return tuple(
            name.removeprefix("frequency_hz").strip() for name in self.values if name.startswith("frequency_hz")
        )

    def of(self, name: str, mode: str = "") -> float:
        """Return a parameter of a mode."""
        return self.values[f"{name} {mode}".strip()]

    def receptances(self, s: Complex) -> Complex:
        """Displacement per force at drive point and response channels, m/N [1 + responses, n]."""
        out = np.zeros((1 + len(self.channels), s.size), np.complex128)
        for mode in self.modes:
            omega = 2.0 * np.pi * self.of("frequency_hz", mode)
            shape = self.of("drive_shape", mode)
            pole = s**2 + 2.0 * self.of("damping_ratio", mode) * omega * s + omega**2
            ratios = np.array([1.0, *(self.of(f"ratio {name}", mode) for name in self.channels)])
            out += shape * shape * ratios[:, None] / pole  # infinite where a fit tries an absurd shape; ** would raise
        return out

    def force_per_v(self, s: Complex, receptance: Complex) -> Complex:
        """Force per volt at the amplifier, N/V, where the drive point has this receptance (m/N)."""
        v = self.values
        lag = 1.0 + s * v["coil_time_constant_s"]
        half = 0.5 * v["exciter_damping_n_s_m"]
        stiffness = s**2 * v["moving_mass_kg"] + s * half * (1.0 + 1.0 / lag) + v["suspension_stiffness_n_m"]
        return v["force_per_volt_n_v"] / lag / (1.0 + stiffness * (receptance + 1.0 / v["stinger_stiffness_n_m"]))

    def responses(self, frequency_hz: Float, sample_rate_hz: float) -> Complex:
        """Responses as `Responses.value` has them."""
        s: Complex = 2j * np.pi * np.asarray(frequency_hz, np.complex128)
        receptances = self.receptances(s)
        late = np.asarray(np.sinc(frequency_hz / sample_rate_hz), np.complex128) * np.exp(-s * self.values["delay_s"])
        late = late * s / (s + 2.0 * np.pi * self.values["coupling_hz"])
        force = self.force_per_v(s, receptances[0]) * late
        return np.asarray(np.vstack([force, s**2 * receptances * force]).T)


@dataclass(frozen=True, eq=False)
class _Linearisation:
    """The fitted residuals of the responses near the most likely rig."""

    responses: Responses
    weight: Float
    """Standard deviations of the residuals, misfit included [n, outputs]."""
    jacobian: Float
    """Slope of the weighted residuals, real parts above imaginary ones [2 n outputs, p]."""
    prior_std: Float
    """Standard deviations of the priors [p]."""
    bounds: tuple[Float, Float]
    """Least and largest possible values of the parameters [p]."""

    def weighted(self, rig: LinearRig) -> Float:
        """Weighted model of a rig [2 n outputs]."""
        model = rig.responses(self.responses.frequency_hz, self.responses.sample_rate_hz) / self.weight
        return np.concatenate([model.ravel().real, model.ravel().imag])


@dataclass(frozen=True, eq=False)
class LinearKnowledge:
    """What is known of the linear rig: the most likely parameters and their covariance."""

    names: tuple[str, ...]
    """Names of the parameters, in the order of ``mean``."""
    positive: NDArray[np.bool_]
    """Which of them are logarithms [p]."""
    mean: Float
    """Most likely values [p]."""
    covariance: Float
    """Covariance [p, p]."""
    channels: tuple[str, ...]
    """Response channels."""
    misfit: float
    """Relative misfit of the responses, root mean square; NaN without responses."""
    inflation: float
    """Squared misfit over its expectation, by which the data's covariance is multiplied where it is above 1."""
    determined: float
    """Share of the parameters' directions whose standard deviation the data have at least halved."""
    near: _Linearisation | None = None
    """The residuals near the most likely rig; None without responses."""

    def rig(self, x: Float | None = None) -> LinearRig:
        """Return the rig of a parameter vector [p]; by default the most likely one."""
        vector = self.mean if x is None else x
        values = np.where(self.positive, np.exp(np.where(self.positive, vector, 0.0)), vector)
        return LinearRig(dict(zip(self.names, values.tolist(), strict=True)), self.channels)

    def std(self, name: str) -> float:
        """Standard deviation of a parameter, relative where it is positive."""
        index = self.names.index(name)
        return float(np.sqrt(self.covariance[index, index]))

    def draw(self, generator: np.random.Generator) -> LinearRig:
        """Draw a rig from the joint distribution.

        Along directions that the data leave wide the responses are no longer linear in the parameters. So a drawn vector is
        moved, as little as its prior allows, until its responses are those that the linearisation gives it: randomised maximum
        likelihood (Oliver, Reynolds and Liu, Inverse Theory for Petroleum Reservoir Characterization, 2008, section 10.7).

        Raises `ConfigurationError` for a vector that cannot be moved there: it belongs to no rig, and another is to be drawn.
        """
        values, vectors = np.linalg.eigh(self.covariance)
        spread = vectors * np.sqrt(np.maximum(values, 0.0))
        drawn = self.mean + spread @ generator.standard_normal(self.mean.size)
        return self.rig(drawn if self.near is None else self._corrected(drawn, self.near))

    def _corrected(self, drawn: Float, near: _Linearisation) -> Float:
        from scipy.optimize import least_squares

        wanted = near.weighted(self.rig()) + near.jacobian @ (drawn - self.mean)

        def misses(x: Float) -> Float:
            return np.concatenate([near.weighted(self.rig(x)) - wanted, (x - drawn) / near.prior_std])

        noise = float(self.mean.size)  # what the noise does, in the mean
        drawn = np.clip(drawn, *near.bounds)
        if float(np.sum(misses(drawn) ** 2)) < noise:
            return drawn
        with np.errstate(over="ignore", invalid="ignore"):
            found = least_squares(misses, drawn, bounds=near.bounds, x_scale=near.prior_std, max_nfev=MOST_CORRECTIONS)
        if not 2.0 * float(found.cost) < noise:
            raise ConfigurationError("no rig has the responses that were drawn")
        return np.asarray(found.x)


class _Parameters:
    """Names, start values and priors of a fit."""

    def __init__(self, channels: Sequence[str], priors: Mapping[str, Prior]) -> None:
        self.channels, self.priors = tuple(channels), dict(priors)
        self.names: list[str] = []
        self.positive: list[bool] = []
        self.centre: list[float] = []
        self.std: list[float] = []
        self.lowest: dict[str, float] = {}

    @property
    def bounds(self) -> tuple[Float, Float]:
        """Least and largest possible values [p]; without bounds for a parameter of any sign."""
        wide = np.where(self.positive, POSSIBLE, np.inf)
        least = [self.lowest.get(name, -np.inf) for name in self.names]
        return np.maximum(self.centre - wide, least), self.centre + wide

    def log(self, name: str, value: float, log_std: float = WIDE) -> None:
        """Add a positive parameter."""
        known = self.priors.get(name, Prior(value, log_std))
        self._add(name, True, float(np.log(known.value)), known.log_std)

    def plain(self, name: str, value: float, std: float) -> None:
        """Add a parameter of any sign."""
        known = self.priors.get(name)
        self._add(name, False, value if known is None else known.value, std if known is None else known.log_std)

    def _add(self, name: str, positive: bool, centre: float, std: float) -> None:
        self.names.append(name)
        self.positive.append(positive)
        self.centre.append(centre)
        self.std.append(std)

    def vector(self, values: Mapping[str, float]) -> Float:
        """Return the vector of named values; what they do not name is at its centre."""
        return np.array(
            [
                centre if name not in values else float(np.log(values[name])) if positive else values[name]
                for name, positive, centre in zip(self.names, self.positive, self.centre, strict=True)
            ]
        )

    def mode(self, mode: str, frequency_hz: float, shape: float, *, log_std: tuple[float, float, float]) -> None:
        """Add a mode; ``log_std``: of frequency, damping ratio and drive shape."""
        end = f" {mode}" if mode else ""
        self.log(f"frequency_hz{end}", frequency_hz, log_std[0])
        self.log(f"damping_ratio{end}", FLOOR_DAMPING, log_std[1])
        self.log(f"drive_shape{end}", shape, log_std[2])
        for name in self.channels:
            self.plain(f"ratio {name}{end}", 0.0 if mode else 1.0, 2.0)


def known_rig(
    channels: Sequence[str], start: Mapping[str, float], priors: Mapping[str, Prior], responses: Responses | None
) -> LinearKnowledge:
    """Return what responses and priors together say of a rig.

    ``channels`` are the names of the response channels. ``start`` has start values of `MODE`, and of `EXCITER` as far as they
    are known; ``priors`` what is known beforehand, by name. What has no prior is that of a shaker that suits the specimen. The
    fit is begun from several shakers, for more than one may be near. Raises `ConfigurationError` if the responses are not those
    of such a rig.
    """
    beside: list[float] = []
    found, worst_hz = _fitted(_parameters(channels, start, priors, responses, beside), responses, _starts(start))
    while responses is not None and found.inflation > UNEXPLAINED and len(beside) < MOST_BESIDE:
        beside.append(worst_hz)
        further = _parameters(channels, start, priors, responses, beside)
        better, worst_hz = _fitted(further, responses, [found.rig().values])
        if better.inflation > EXPLAINED * found.inflation:
            break
        found = better
    return found


def suitable_shaker(mode: Mapping[str, float]) -> dict[str, Prior]:
    """Return what is assumed of a shaker that nobody has measured, by the mode (`MODE`) that it drives.

    Its moving mass is half the modal mass, its suspension resonates at 25 Hz, or at the mode if that is lower, with half of
    critical damping; each within a factor of four or so.
    """
    mass = 0.5 / mode["drive_shape"] ** 2
    omega = 2.0 * np.pi * min(25.0, mode["frequency_hz"])
    return {
        "force_per_volt_n_v": Prior(mode.get("force_per_volt_n_v", 3.0), 2.0),
        "coil_time_constant_s": Prior(1e-4, WIDE),
        "moving_mass_kg": Prior(mass, 1.4),
        "exciter_damping_n_s_m": Prior(mass * omega, 1.4),
        "suspension_stiffness_n_m": Prior(mass * omega**2, 1.4),
        "stinger_stiffness_n_m": Prior(5e6, 1.4),
    }


def _starts(start: Mapping[str, float]) -> list[Mapping[str, float]]:
    """Return the shakers from which a fit is begun: as a first fit has it, and suitable ones of several masses."""
    suitable = {name: prior.value for name, prior in suitable_shaker(start).items()}
    out: list[Mapping[str, float]] = [start]
    for times in (0.3, 1.0, 3.0):
        scaled = {name: times * suitable[name] for name in EXCITER[2:5]}
        out.append({**suitable, **scaled, **{name: start[name] for name in MODE if name in start}})
    return out


def _parameters(
    channels: Sequence[str],
    start: Mapping[str, float],
    priors: Mapping[str, Prior],
    responses: Responses | None,
    beside: Sequence[float],
) -> _Parameters:
    out = _Parameters(channels, priors)
    shape, hertz = start["drive_shape"], start["frequency_hz"]
    out.mode("", hertz, shape, log_std=(0.1, 1.5, WIDE))
    for name, shaker in suitable_shaker(start).items():
        out.log(name, shaker.value, shaker.log_std)
    rate = 5000.0 if responses is None else responses.sample_rate_hz
    out.plain("delay_s", 0.0, 2.0 / rate)
    out.log("coupling_hz", COUPLING_HZ)
    lowest, highest = (0.4 * hertz, 2.5 * hertz) if responses is None else responses.frequency_hz[[0, -1]]
    out.mode("low", LOW * float(lowest), 0.1 * shape, log_std=(1e-3, 1e-3, 2.0))
    out.mode("high", HIGH * float(highest), shape, log_std=(0.5, 1e-3, 2.0))
    out.lowest["frequency_hz high"] = float(np.log(ABOVE * highest))
    for number, line_hz in enumerate(beside, 2):
        out.mode(str(number), line_hz, 0.3 * shape, log_std=(0.1, 1.5, 2.0))
    return out


def _fitted(
    parameters: _Parameters, responses: Responses | None, starts: Sequence[Mapping[str, float]]
) -> tuple[LinearKnowledge, float]:
    """Return the best of the fits from several starts, and the line (Hz) that fits worst."""
    from scipy.optimize import least_squares

    centre, std = np.array(parameters.centre), np.array(parameters.std)
    positive = np.array(parameters.positive)
    names, channels = tuple(parameters.names), parameters.channels
    prior = np.diag(std**2)

    def knowledge(x: Float, covariance: Float, misfit: float, inflation: float, determined: float) -> LinearKnowledge:
        return LinearKnowledge(names, positive, x, covariance, channels, misfit, inflation, determined)

    if responses is None:
        return knowledge(centre, prior, float("nan"), 1.0, 0.0), 0.0
    scale = np.sqrt(np.mean(np.abs(responses.value) ** 2, axis=0))
    sigma = np.sqrt(responses.std**2 + (MODEL_FLOOR * np.abs(responses.value)) ** 2 + (0.2 * MODEL_FLOOR * scale) ** 2)

    def misses(x: Float) -> Complex:
        model = knowledge(x, prior, 0.0, 1.0, 0.0).rig().responses(responses.frequency_hz, responses.sample_rate_hz)
        return np.asarray(model - responses.value)

    def residuals(x: Float) -> Float:
        error = (misses(x) / sigma).ravel()
        return np.concatenate([error.real, error.imag, (x - centre) / std])

    bounds = parameters.bounds
    fits = []
    with np.errstate(over="ignore", invalid="ignore"):
        for start in starts:
            x = np.clip(_as_strong(parameters.vector(start), names, knowledge, responses), *bounds)
            fits.append(least_squares(residuals, x, bounds=bounds, x_scale=std, max_nfev=100, ftol=1e-7, xtol=1e-7))
    found = min(fits, key=lambda fit: float(fit.cost))
    if not np.all(np.isfinite(found.fun)):
        raise ConfigurationError("the responses are not those of a shaker, a stinger and a structure near one mode")
    error = misses(found.x)
    expected = max(2 * error.size - centre.size, 1)
    inflation = float(np.sum(np.abs(error / sigma) ** 2)) / expected
    data = np.asarray(found.jac)[: 2 * error.size] / np.sqrt(max(1.0, inflation))
    covariance = np.linalg.inv(data.T @ data + np.diag(std**-2.0))
    whitened = covariance / np.outer(std, std)
    determined = float(np.mean(np.linalg.eigvalsh(whitened) < 0.25))
    relative = np.abs(error) / scale
    worst = responses.frequency_hz[int(np.argmax(relative[:, 1]))]
    misfit = float(np.sqrt(np.mean(relative**2)))
    near = _Linearisation(responses, sigma * np.sqrt(max(1.0, inflation)), data, std, bounds)
    return replace(knowledge(found.x, covariance, misfit, inflation, determined), near=near), float(worst)


def _as_strong(
    x: Float, names: Sequence[str], knowledge: Callable[..., LinearKnowledge], responses: Responses
) -> Float:
    """Return a start vector with the force per volt at which its force is as large as the measured one, in the median."""
    model = knowledge(x, np.empty(0), 0.0, 1.0, 0.0).rig().responses(responses.frequency_hz, responses.sample_rate_hz)
    ratio = float(np.median(np.abs(responses.value[:, 0]) / np.abs(model[:, 0])))
    out = x.copy()
    out[names.index("force_per_volt_n_v")] += np.log(ratio)
    return out
