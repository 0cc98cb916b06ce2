"""From recordings to models."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast, get_args

from identification import (
    Backbone,
    Exciter,
    FrequencyResponseMatrix,
    LinearModes,
    ModalAnalysis,
    NonlinearMode,
    combined,
    extrapolated_to_zero,
    identify_exciter,
    linear_modes,
    nonlinear_mode,
    stabilisation,
    stepped_sine_mode,
)
from rig.errors import ConfigurationError, RecordingError
from rig.measurements import Estimator, backbone, bench_of_recording, response_matrices, spectra
from rig.models.files import KINDS, load, load_as
from rig.models.frequency_responses import FREQUENCY_RESPONSES
from rig.models.linear_modes import LINEAR_MODES
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording

__all__ = ["Request", "identify_model", "modes_in"]


@dataclass(frozen=True, kw_only=True)
class Request:
    """What is to be identified, and how."""

    kind: str = "nonlinear-mode"
    """``nonlinear-mode``, ``linear`` or ``exciter``."""
    modes: Path | None = None
    """Linear model whose mode shapes a nonlinear mode uses."""
    estimator: str = "instrument"
    """Of the responses of a linear model: ``instrument``, ``H1`` or ``H2``."""
    band_hz: tuple[float, float] | None = None
    """Lines that a linear or exciter model is fitted to."""
    count: int | None = None
    """Number of modes of a linear model; found if None."""

    def __post_init__(self) -> None:
        if self.kind not in _MODELS:
            raise ConfigurationError(f"--model = {self.kind!r}: allowed are {', '.join(_MODELS)}")
        if self.estimator not in get_args(Estimator):
            raise ConfigurationError(f"--estimator = {self.estimator!r}: allowed are {', '.join(get_args(Estimator))}")
        if self.band_hz is not None and not 0.0 <= self.band_hz[0] < self.band_hz[1]:
            raise ConfigurationError(
                f"--band = {self.band_hz[0]:g} {self.band_hz[1]:g}: allowed is 0 <= LOW < HIGH, Hz"
            )
        given = {
            "--modes": self.modes is not None,
            "--band": self.band_hz is not None,
            "--count": self.count is not None,
            "--estimator": self.estimator != "instrument",
        }
        for name in (name for name, is_given in given.items() if is_given):
            if name not in _OPTIONS[self.kind]:
                allowed = ", ".join(_OPTIONS[self.kind]) or "no such option"
                raise ConfigurationError(f"{name}: means nothing to --model {self.kind}, which takes {allowed}")


def identify_model(paths: Sequence[Path], request: Request) -> Any:
    """The model in recordings or imported measurements.

    Raises `RecordingError` for files that hold something else, `identification.IdentificationError` where the data does not
    allow it.
    """
    return _MODELS[request.kind](paths, request)


def modes_in(path: Path) -> LinearModes:
    """The linear modes in a file of a modal analysis."""
    return cast(ModalAnalysis, load_as(LINEAR_MODES, path)).modes


def _nonlinear_mode(paths: Sequence[Path], request: Request) -> NonlinearMode:
    """From one or several backbones, or from imported stepped sines."""
    kinds = {kind_of(path): path for path in paths}
    modes = None if request.modes is None else modes_in(request.modes)
    if set(kinds) == {FREQUENCY_RESPONSES.name}:
        if modes is not None:
            raise ConfigurationError("--modes: stepped sines of one sensor have no use for mode shapes; leave it out")
        return stepped_sine_mode([response for path in paths for response in load(path)])
    backbones = [_backbone(path) for path in paths]
    identified = [nonlinear_mode(measured, modes=modes) for measured in backbones]
    return identified[0] if len(identified) == 1 else combined(identified)


def _backbone(path: Path) -> Backbone:
    kind = kind_of(path)
    if kind in KINDS and isinstance(measured := load(path), Backbone):
        return measured
    if kind != "backbone":
        raise RecordingError(
            f"{path}: holds a {kind}; a nonlinear mode comes from backbones, or from stepped sines alone"
        )
    with Recording(path) as recording:
        return backbone(recording)


def _linear(paths: Sequence[Path], request: Request) -> ModalAnalysis:
    """From multisines or frequency responses; levels are extrapolated to zero force."""
    estimator = cast(Estimator, request.estimator)
    matrices = [matrix for path in paths for matrix in _matrices(path, estimator)]
    if request.band_hz is not None:
        low, high = request.band_hz
        matrices = [matrix.select(lowest_hz=low, highest_hz=high) for matrix in matrices]
    matrices.sort(key=lambda matrix: matrix.input_rms or (0.0,))
    found = [linear_modes(matrix, modes=request.count) for matrix in matrices]
    lowest = matrices[0]
    modes = found[0] if len(found) == 1 else extrapolated_to_zero(*found)
    return ModalAnalysis(modes, lowest, stabilisation(lowest))


def _matrices(path: Path, estimator: Estimator) -> list[FrequencyResponseMatrix]:
    kind = kind_of(path)
    if kind == "multisine":
        with Recording(path) as recording:
            return list(response_matrices(recording, estimator=estimator).values())
    if kind in KINDS and isinstance(matrix := load(path), FrequencyResponseMatrix):
        return [matrix]
    raise RecordingError(f"{path}: holds a {kind}; a linear model comes from multisines or frequency response matrices")


def _exciter(paths: Sequence[Path], request: Request) -> Exciter:
    """From one multisine: its highest level."""
    if len(paths) != 1:
        raise ConfigurationError(f"--model exciter: {len(paths)} files given, allowed is one multisine recording")
    kind = kind_of(paths[0])
    if kind != "multisine":
        raise RecordingError(f"{paths[0]}: holds a {kind}; an exciter model comes from a multisine")
    low, high = request.band_hz or (None, None)
    with Recording(paths[0]) as recording:
        bench = bench_of_recording(recording)
        _, at_level = max(spectra(recording).items())
    return identify_exciter(
        at_level,
        lowest_hz=low,
        highest_hz=high,
        sample_rate_hz=bench.sample_rate_hz,
        source=f"{bench.name}, {bench.specimen.name}",
    )


_MODELS: dict[str, Callable[[Sequence[Path], Request], Any]] = {
    "nonlinear-mode": _nonlinear_mode,
    "linear": _linear,
    "exciter": _exciter,
}
_OPTIONS = {
    "nonlinear-mode": ("--modes",),
    "linear": ("--estimator", "--band", "--count"),
    "exciter": ("--band",),
}
