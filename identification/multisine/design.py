"""Multisines: periodic signals with given amplitudes and random phases on chosen lines of the frequency grid.

Pintelon and Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., chapter 5. The signal of a period of N
samples is ``u(n) = sum_k A_k cos(2 pi k n / N + phi_k)`` with ``phi_k`` uniformly distributed over the circle. Its RMS is
``sqrt(sum A_k^2 / 2)``. The zero-order hold of the converter attenuates line f by ``sinc(f / sample rate)``; the design does
not compensate for that.

Detection lines are not excited (section 4.3): under odd excitation an even nonlinearity appears only at even lines, an odd one
only at odd lines. A random few odd lines are therefore left out.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.validation import finite_array, positive
from vibrolock.arrays import Float

Grid = Literal["full", "odd", "odd-random"]

_GRID_KEY = 2**32 - 1
"""Key of the random stream that chooses detection lines; no realisation has it."""
_ROUNDING = 1e-9
"""Relative distance of a limit from a line within which it counts as on the line. Chosen: above rounding."""
_LONGEST_PERIOD = 1e8  # samples; nearly a gigabyte
_LONGEST_KEPT = 2**20
"""Samples of a period up to which the last realisations are kept. Chosen: 8 MB each, and a test asks for each several times."""


@dataclass(frozen=True)
class MultisineDesign:
    """A multisine without its phases, which a realisation draws.

    Raises `IdentificationError` if the band has no line or reaches half the sample rate, or if a number is out of its
    range.

    Parameters
    ----------
    sample_rate_hz
        Samples per second.
    period_samples
        Samples N of a period; lines lie ``sample_rate_hz / N`` apart.
    lowest_hz, highest_hz
        Band of the excited lines, both ends included.
    grid
        ``full`` excites every line of the band, ``odd`` only the odd multiples of the resolution. ``odd-random`` excites
        these except one random line of every ``detection_group``. A line that is not excited is a detection line.
    rms
        RMS of `realisation`, in the unit of the played signal.
    relative_amplitudes
        Relative amplitudes of the excited lines; None for a flat spectrum.
    detection_group
        Number of odd lines in a group, of which ``odd-random`` leaves one out.
    grid_seed
        Seed that chooses the line left out. All realisations excite the same lines, so that their spectra can be averaged.
    """

    sample_rate_hz: float
    period_samples: int
    lowest_hz: float
    highest_hz: float
    grid: Grid = "full"
    rms: float = 1.0
    relative_amplitudes: tuple[float, ...] | None = None
    detection_group: int = 4
    grid_seed: int = 0

    def __post_init__(self) -> None:
        for name in ("sample_rate_hz", "lowest_hz", "highest_hz"):
            positive(name, getattr(self, name), "Hz")
        positive("rms", self.rms)
        IdentificationError.unless_at_least("period_samples", self.period_samples, 3)
        IdentificationError.unless_one_of("grid", self.grid, get_args(Grid))
        IdentificationError.unless_at_least("detection_group", self.detection_group, 2)
        IdentificationError.unless_at_least("grid_seed", self.grid_seed, 0)
        if self.highest_hz < self.lowest_hz:
            raise IdentificationError(
                field="highest_hz", value=self.highest_hz, allowed=f"lowest_hz = {self.lowest_hz:g} Hz"
            )
        if self.highest_hz >= 0.5 * self.sample_rate_hz:
            allowed = f"below half the sample rate, {0.5 * self.sample_rate_hz:g} Hz"
            raise IdentificationError(field="highest_hz", value=self.highest_hz, allowed=allowed)
        if not self.lines.size:
            group = (
                f", of which it takes groups of {self.detection_group} odd ones" if self.grid == "odd-random" else ""
            )
            raise IdentificationError(
                f"no line of the {self.grid} grid in {self.lowest_hz:g} to {self.highest_hz:g} Hz; lines are "
                f"{self.resolution_hz:g} Hz apart{group}",
                field="lowest_hz, highest_hz",
            )
        if self.relative_amplitudes is not None:
            self._check_amplitudes(self.relative_amplitudes)

    def _check_amplitudes(self, relative: tuple[float, ...]) -> None:
        object.__setattr__(self, "relative_amplitudes", tuple(relative))
        values = finite_array("relative_amplitudes", relative, np.float64, 1)
        if values.size != self.lines.size:
            raise IdentificationError(
                f"has {values.size} values for {self.lines.size} lines", field="relative_amplitudes"
            )
        if np.any(values < 0.0) or not np.any(values):
            reason = f"lowest is {values.min():g}, highest {values.max():g}"
            raise IdentificationError(reason, field="relative_amplitudes", allowed="none below zero, one above")

    @classmethod
    def with_resolution(
        cls,
        *,
        sample_rate_hz: float,
        resolution_hz: float,
        lowest_hz: float,
        highest_hz: float,
        grid: Grid = "full",
        rms: float = 1.0,
        detection_group: int = 4,
        grid_seed: int = 0,
    ) -> "MultisineDesign":
        """Create a design from the spacing of its lines; a period must be a whole number of samples."""
        samples = positive("sample_rate_hz", sample_rate_hz, "Hz") / positive("resolution_hz", resolution_hz, "Hz")
        if not 3.0 <= samples <= _LONGEST_PERIOD:
            reason = f"a period has {samples:.4g} samples at {sample_rate_hz:g} Hz"
            allowed = f"3 to {_LONGEST_PERIOD:.0e}"
            raise IdentificationError(reason, field="resolution_hz", value=resolution_hz, allowed=allowed)
        if abs(samples - round(samples)) > 1e-6:
            reason = f"a period has {samples:.4f} samples at {sample_rate_hz:g} Hz"
            allowed = f"a whole number, such as {sample_rate_hz / round(samples):.9g} Hz gives"
            raise IdentificationError(reason, field="resolution_hz", value=resolution_hz, allowed=allowed)
        return cls(
            sample_rate_hz,
            round(samples),
            lowest_hz,
            highest_hz,
            grid,
            rms,
            detection_group=detection_group,
            grid_seed=grid_seed,
        )

    @property
    def resolution_hz(self) -> float:
        """Spacing of neighbouring lines."""
        return self.sample_rate_hz / self.period_samples

    @property
    def period_s(self) -> float:
        """Length of a period."""
        return self.period_samples / self.sample_rate_hz

    @cached_property
    def band_lines(self) -> NDArray[np.int64]:
        """int[n]: every line of the band, excited or not, as a multiple of the resolution."""
        first = int(np.ceil(self.lowest_hz / self.resolution_hz * (1.0 - _ROUNDING)))
        last = int(np.floor(self.highest_hz / self.resolution_hz * (1.0 + _ROUNDING)))
        return np.arange(first, last + 1)

    @cached_property
    def lines(self) -> NDArray[np.int64]:
        """int[n_lines]: the excited lines, as multiples of the resolution; an incomplete last group is fully excited."""
        if self.grid == "full":
            return self.band_lines
        odd: NDArray[np.int64] = self.band_lines[self.band_lines % 2 == 1]
        if self.grid == "odd":
            return odd
        groups = odd.size // self.detection_group
        if not groups:
            return odd[:0]
        random = np.random.default_rng(np.random.SeedSequence(self.grid_seed, spawn_key=(_GRID_KEY,)))
        silent = np.arange(groups) * self.detection_group + random.integers(0, self.detection_group, groups)
        return np.asarray(np.delete(odd, silent))

    @property
    def detection_lines_odd(self) -> NDArray[np.int64]:
        """int[n]: odd lines of the band that are not excited, at which odd nonlinearity appears."""
        return np.asarray(np.setdiff1d(self.band_lines[self.band_lines % 2 == 1], self.lines))

    @property
    def detection_lines_even(self) -> NDArray[np.int64]:
        """int[n]: even lines of the band that are not excited, at which even nonlinearity appears."""
        return np.asarray(np.setdiff1d(self.band_lines[self.band_lines % 2 == 0], self.lines))

    @property
    def folding_degree(self) -> int:
        """Lowest degree of nonlinearity whose products above half the sample rate alias back into the band."""
        return int(np.ceil(self.sample_rate_hz / self.highest_hz - 1.0 - _ROUNDING))

    @property
    def frequency_hz(self) -> Float:
        """float[n_lines]: frequencies of the excited lines."""
        return np.asarray(self.lines * self.resolution_hz)

    @property
    def amplitudes(self) -> Float:
        """float[n_lines]: peak amplitude A_k of every excited line, in the unit of ``rms``."""
        relative = np.ones(self.lines.size) if self.relative_amplitudes is None else np.array(self.relative_amplitudes)
        return np.asarray(relative * self.rms * np.sqrt(2.0 / np.sum(relative**2)))

    def realisation(self, seed: int, index: int) -> Float:
        """float[period_samples]: one period with RMS ``rms``; the same seed and index always give the same period.

        Realisations of one seed are statistically independent, and none depends on how many are drawn.
        """
        if self.period_samples > _LONGEST_KEPT:
            return np.asarray(self._signals(self._phases(seed, index, 1))[0])
        return _kept_realisation(self, seed, index).copy()

    def orthogonal_realisation(self, seed: int, index: int, n_inputs: int) -> Float:
        """float[n_inputs, n_inputs, period_samples]: signals of each experiment of a block at each input, with RMS ``rms``.

        In experiment e, input i plays its phases ``phi_i`` shifted by ``2 pi i e / n_inputs`` (the matrix of the discrete
        Fourier transform). At every line the spectra of the experiments are then orthogonal, so that the block can be
        inverted without loss (Dobrowiecki and Schoukens, Automatica 43, 2007). With one input the block is `realisation`.
        """
        IdentificationError.unless_at_least("n_inputs", n_inputs, 1)
        turns = np.outer(np.arange(n_inputs), np.arange(n_inputs)) * (2.0 * np.pi / n_inputs)
        phases = self._phases(seed, index, n_inputs)
        return self._signals(phases + turns[:, :, None])

    def _phases(self, seed: int, index: int, inputs: int) -> Float:
        """float[inputs, n_lines]: phases uniformly distributed over the circle."""
        for name, value in (("seed", seed), ("index", index)):
            IdentificationError.raise_if(value < 0, field=name, value=value, allowed="zero or more")
        random = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
        return random.uniform(0.0, 2.0 * np.pi, (inputs, self.lines.size))

    def _signals(self, phases: Float) -> Float:
        """float[..., period_samples]: one period with the phases float[..., n_lines]."""
        spectrum = np.zeros((*phases.shape[:-1], self.period_samples // 2 + 1), dtype=np.complex128)
        spectrum[..., self.lines] = 0.5 * self.period_samples * self.amplitudes * np.exp(1j * phases)
        return np.asarray(np.fft.irfft(spectrum, self.period_samples))

    def unit_peak(self, seed: int, index: int) -> Float:
        """float[period_samples]: the period of `realisation` scaled to a largest absolute value of one."""
        signal = self.realisation(seed, index)
        return np.asarray(signal / np.max(np.abs(signal)))

    def crest_factor(self, seed: int, index: int) -> float:
        """Largest absolute value over RMS, so that ``realisation`` is ``unit_peak`` times ``crest_factor * rms``."""
        return float(np.max(np.abs(self.realisation(seed, index)))) / self.rms


@lru_cache(maxsize=8)
def _kept_realisation(design: MultisineDesign, seed: int, index: int) -> Float:
    return np.asarray(design._signals(design._phases(seed, index, 1))[0])
