"""Compare several backbones of one specimen: mean, scatter between runs, and one model whose errors include the scatter.

Different runs do not reach the same amplitudes. The properties of each run are therefore interpolated (PCHIP) over the
drive-point amplitude to common levels within the range that all runs cover. The observed variance includes the random error
within each run, so that the variance between runs is ``s_between^2 = s_observed^2 - mean s_within^2``.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.backbones import Backbone
from identification.errors import IdentificationError
from identification.nonlinear.nonlinear_modes import QUANTITIES, STANDARD_ERRORS, NonlinearMode
from identification.nonlinear.phase_resonance import nonlinear_mode
from identification.validation import table_rows
from vibrolock.arrays import Complex, Float


@dataclass(frozen=True, eq=False, kw_only=True)
class Repeatability:
    """Modal frequency and damping of several runs at common amplitudes.

    Parameters
    ----------
    amplitude_m
        float[n], amplitudes of the drive point that all runs cover.
    modal_frequency_hz, damping_ratio
        float[n_runs, n], values of each run.
    modal_frequency_within_hz, damping_ratio_within
        float[n], random standard error of a single run, RMS over runs; NaN if unknown.
    specimen
        Name of what was tested.
    """

    amplitude_m: Float
    modal_frequency_hz: Float
    damping_ratio: Float
    modal_frequency_within_hz: Float
    damping_ratio_within: Float
    specimen: str = ""

    def mean(self, quantity: str) -> Float:
        """float[n]: mean over runs of ``modal_frequency_hz`` or ``damping_ratio``."""
        return np.asarray(np.mean(self._runs(quantity), axis=0))

    def std(self, quantity: str) -> Float:
        """float[n]: observed standard deviation over runs."""
        return np.asarray(np.std(self._runs(quantity), axis=0, ddof=1))

    def range(self, quantity: str) -> Float:
        """float[n]: largest minus smallest value over runs."""
        return np.asarray(np.ptp(self._runs(quantity), axis=0))

    def between(self, quantity: str) -> Float:
        """float[n]: standard deviation between runs without the random error within them, which counts as 0 if unknown."""
        within = self.modal_frequency_within_hz if quantity == "modal_frequency_hz" else self.damping_ratio_within
        return np.asarray(np.sqrt(np.maximum(self.std(quantity) ** 2 - np.nan_to_num(within) ** 2, 0.0)))

    def scatter(self, quantity: str) -> tuple[float, float, float]:
        """Return the relative scatter of whole runs, and both ends of its 95 % interval for this number of runs.

        The deviation of each run from the mean is averaged over the levels, because a specimen that is stiffer in one run is
        stiffer at all levels. The standard deviation of this average over R runs has a chi distribution with R - 1 degrees of
        freedom.
        """
        from scipy.stats import chi2

        runs = self._runs(quantity)
        shift = np.mean(runs / np.mean(runs, axis=0) - 1.0, axis=1)
        free = runs.shape[0] - 1
        size = float(np.std(shift, ddof=1))
        low, high = (float(size * np.sqrt(free / chi2.ppf(p, free))) for p in (0.975, 0.025))
        return size, low, high

    def table(self) -> list[dict[str, float | None]]:
        """Return one JSON-able dictionary per common amplitude."""
        columns = {"amplitude_m": self.amplitude_m}
        for name in ("modal_frequency_hz", "damping_ratio"):
            columns[name] = self.mean(name)
            columns[f"{name}_std"] = self.std(name)
            columns[f"{name}_range"] = self.range(name)
            columns[f"{name}_between"] = self.between(name)
        return table_rows(columns)

    def _runs(self, quantity: str) -> Float:
        IdentificationError.unless_one_of("quantity", quantity, ("modal_frequency_hz", "damping_ratio"))
        return np.asarray(getattr(self, quantity))


def repeatability(runs: Sequence[NonlinearMode | Backbone]) -> Repeatability:
    """Compare several backbones of the same specimen at common amplitudes.

    Raises `IdentificationError` if there are fewer than two runs, specimens or channels differ, or runs have no common
    range of amplitudes.

    Parameters
    ----------
    runs
        Nonlinear modes, or backbones (identified with their ``drive_mode_shape``). A backbone with several passes, up and
        down or repeated, counts as one run per pass. At least two runs are needed.
    """
    modes = _modes(runs)
    levels = _common_levels(modes)
    within = {name: np.array([_at(levels, mode, mode.random(name)) for mode in modes]) for name in _COMPARED}
    return Repeatability(
        amplitude_m=levels,
        modal_frequency_hz=np.array([_at(levels, mode, mode.modal_frequency_hz) for mode in modes]),
        damping_ratio=np.array([_at(levels, mode, mode.damping_ratio) for mode in modes]),
        modal_frequency_within_hz=np.sqrt(np.mean(within["modal_frequency_hz"] ** 2, axis=0)),
        damping_ratio_within=np.sqrt(np.mean(within["damping_ratio"] ** 2, axis=0)),
        specimen=modes[0].specimen,
    )


def combined(runs: Sequence[NonlinearMode | Backbone]) -> NonlinearMode:
    """Combine several runs to one nonlinear mode whose standard errors hold for a further run of the specimen.

    Properties are means over runs at common amplitudes. Their variance is ``(1 + 1/R) s_observed^2`` over R runs plus the
    variance of the systematic errors, which all runs share. If the mean random variance within the runs is larger than
    ``s_observed^2``, it is used instead. Intervals use Student's quantile for R runs. Before averaging, harmonics are rotated
    so that the fundamental of the drive point is real.

    Raises `IdentificationError` as for `repeatability`.
    """
    from scipy.stats import t

    modes = _modes(runs)
    levels = _common_levels(modes)
    count = len(modes)
    out: dict[str, Float] = {"amplitude_m": levels}
    intervals = np.full((levels.size, len(QUANTITIES), 2), np.nan)
    systematic, random = (np.full((levels.size, len(QUANTITIES)), np.nan) for _ in range(2))
    for column, name in enumerate(QUANTITIES):
        values = np.array([_at(levels, mode, getattr(mode, name)) for mode in modes])
        own = np.array([_at(levels, mode, mode.random(name)) for mode in modes])
        shared = np.mean([_at(levels, mode, mode.systematic(name)) for mode in modes], axis=0)
        mean, scatter = np.mean(values, axis=0), np.std(values, axis=0, ddof=1)
        if name == "amplitude_m":  # the levels are chosen, not found
            mean, scatter = levels, np.zeros(levels.size)
        scatter = np.sqrt((1.0 + 1.0 / count) * np.fmax(scatter**2, np.mean(own**2, axis=0)))
        out[name], out[STANDARD_ERRORS[name]] = mean, np.hypot(scatter, np.nan_to_num(shared))
        systematic[:, column], random[:, column] = shared, scatter
        half = np.hypot(t.ppf(0.975, count - 1) * scatter, 1.96 * np.nan_to_num(shared))
        intervals[:, column] = np.column_stack([mean - half, mean + half])
        if name in ("mac", "force_purity", "response_purity"):
            intervals[:, column] = np.clip(intervals[:, column], 0.0, 1.0)
    for name in ("frequency_hz", "damping_ratio_uncorrected", "fit_residual"):
        out[name] = np.mean([_at(levels, mode, getattr(mode, name)) for mode in modes], axis=0)
    shapes = {(mode.drive_mode_shape, mode.drive_mode_shape_std, mode.drive_mode_shape_source) for mode in modes}
    shape, shape_std, shape_source = shapes.pop() if len(shapes) == 1 else (None, None, "")
    harmonics = min(mode.force_harmonics.shape[1] for mode in modes)
    return NonlinearMode(
        **out,
        systematic_std=systematic,
        random_std=random,
        interval_95=intervals,
        force_harmonics=_mean_harmonics(levels, modes, "force_harmonics", harmonics),
        response_harmonics_m=_mean_harmonics(levels, modes, "response_harmonics_m", harmonics),
        source="several backbones",
        specimen=modes[0].specimen,
        drive_mode_shape=shape,
        drive_mode_shape_std=shape_std,
        drive_mode_shape_source=shape_source,
        notes=(*_scatter_notes(modes), *dict.fromkeys([note for mode in modes for note in mode.notes])),
    )


def _scatter_notes(modes: Sequence[NonlinearMode]) -> tuple[str, ...]:
    """Return a note each on the scatter of frequency and damping between runs; none where it is unknown."""
    found = repeatability(modes)
    notes = []
    for name, what in (("modal_frequency_hz", "modal frequency"), ("damping_ratio", "damping")):
        size, low, high = (100.0 * part for part in found.scatter(name))
        if np.isfinite(size):
            notes.append(
                f"{len(modes)} runs: {what} scatters by {size:.2g} % from run to run (95 %: {low:.2g} to {high:.2g} %)"
            )
    return tuple(notes)


_COMPARED = ("modal_frequency_hz", "damping_ratio")


def _modes(runs: Sequence[NonlinearMode | Backbone]) -> list[NonlinearMode]:
    backbones = [run for run in runs if isinstance(run, Backbone)]
    for number, backbone in enumerate(backbones[1:], 2):
        if backbone.channels != backbones[0].channels:
            names = ", ".join(channel.name for channel in backbone.channels)
            first = ", ".join(channel.name for channel in backbones[0].channels)
            raise IdentificationError(f"channels of backbone {number} are {names}, of the first {first}", field="runs")
    modes = [
        mode
        for run in runs
        for mode in ([run] if isinstance(run, NonlinearMode) else [nonlinear_mode(one) for one in run.passes()])
    ]
    IdentificationError.raise_if(len(modes) < 2, f"{len(modes)} given, repeatability needs two at least", field="runs")
    for number, mode in enumerate(modes, 1):
        if (size := np.unique(mode.amplitude_m).size) < 2:
            raise IdentificationError(f"run {number} has {size} amplitude, a curve needs two at least", field="runs")
    if len(specimens := {mode.specimen for mode in modes}) > 1:
        raise IdentificationError(f"of different specimens ({', '.join(sorted(specimens))})", field="runs")
    if len(sources := {mode.source for mode in modes}) > 1:
        raise IdentificationError(f"from different kinds of tests ({', '.join(sorted(sources))})", field="runs")
    return modes


def _common_levels(modes: Sequence[NonlinearMode]) -> Float:
    """Return amplitudes within the range of all runs: level means if all runs have as many levels, else log-spaced values."""
    amplitudes = [np.sort(mode.amplitude_m) for mode in modes]
    low, high = max(a[0] for a in amplitudes), min(a[-1] for a in amplitudes)
    if not low < high:
        ranges = ", ".join(f"{1000.0 * a[0]:.4g} to {1000.0 * a[-1]:.4g} mm" for a in amplitudes)
        raise IdentificationError(f"no common range of amplitudes; {ranges}", field="runs")
    sizes = {a.size for a in amplitudes}
    levels = np.mean(amplitudes, axis=0) if len(sizes) == 1 else np.geomspace(low, high, min(sizes))
    return np.unique(np.clip(levels, low, high))


def _at(levels: Float, mode: NonlinearMode, values: Float) -> Float:
    """Return ``values`` of a run interpolated to the common levels; NaN if they are unknown."""
    from scipy.interpolate import PchipInterpolator

    amplitude, first = np.unique(mode.amplitude_m, return_index=True)
    if not np.isfinite(values[first]).all():
        return np.full(levels.size, np.nan)
    return np.asarray(PchipInterpolator(amplitude, values[first])(levels))


def _mean_harmonics(levels: Float, modes: Sequence[NonlinearMode], name: str, harmonics: int) -> Complex:
    """complex[n, H + 1]: mean over runs, after a rotation that makes the fundamental of the drive point real."""
    out = np.empty((levels.size, harmonics), np.complex128)
    orders = np.arange(harmonics)
    turned = [
        getattr(mode, name)[:, :harmonics] * np.exp(-1j * np.outer(np.angle(mode.response_harmonics_m[:, 1]), orders))
        for mode in modes
    ]
    for h in orders:
        real, imaginary = (
            [_at(levels, mode, part(rows[:, h])) for mode, rows in zip(modes, turned, strict=True)]
            for part in (np.real, np.imag)
        )
        out[:, h] = np.mean(real, axis=0) + 1j * np.mean(imaginary, axis=0)
    return out
