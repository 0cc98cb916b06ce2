"""Steady responses of models of any kind: one function for each question, with one set of defaults."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, TypedDict, Unpack

from numpy.typing import ArrayLike

from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.experiments.simulation import Simulation
from identification.harmonic_balance.setting_up import Held
from identification.harmonic_balance.states import HarmonicResponse, SteadyStates
from identification.linear.modes import LinearModes
from identification.models.dynamic_model import LARGEST_RANGE_USE, DynamicModel, SteadyRequest, dynamic_model
from identification.prediction.steady_prediction import ResponseBand, SteadyPrediction, band_of_responses
from identification.renamed import formerly

_COMMON = {"force", "harmonics", "points", "largest_range_use"}
"""Options that every kind of model has."""

_ANY_RANGE = 1e3
"""Largest use of the range of responses that are followed however far they go."""

Band = tuple[float | None, float | None]


class StateOptions(TypedDict, total=False):
    """Options of a steady vibration; `frequency_response` describes them, `SteadyRequest` has their defaults."""

    force: Held | None
    exciter: Exciter | None
    held_inputs: Mapping[str, float] | None
    support: bool | None
    harmonics: int
    samples: int | None
    largest_range_use: float
    stability: bool


class BackboneOptions(StateOptions, total=False):
    """Options of a path of steady vibrations."""

    points: int


class HarmonicOptions(BackboneOptions, total=False):
    """Options of a path over frequency."""

    voltage_v: float | None
    band_hz: Band | None


class ResponseOptions(HarmonicOptions, total=False):
    """Options of `frequency_response`."""

    linear_modes: LinearModes | None
    residuals: bool | None
    lowest_share: float | None


@formerly
def frequency_response(
    model: object, force_n: float | None = None, **options: Unpack[ResponseOptions]
) -> SteadyPrediction:
    """Predict the steady response of a model to a constant force or voltage, on all branches.

    Raises `IdentificationError` if options do not fit the model, a number is not allowed, or no vibration is found, and
    `ExtrapolationError` if the response of a nonlinear mode needs more than ``largest_range_use`` times the largest identified
    amplitude.

    Parameters
    ----------
    model
        A `NonlinearMode`, `PnlssModel`, `StructuredModel` or `StructuredFit`.
    force_n
        Held force, N: the peak of its fundamental, or its RMS if ``force`` is ``rms``.
    voltage_v
        In place of ``force_n``: the held amplitude of a sine of voltage, V, at the exciter.
    force
        Quantity of the force that is constant. ``pure-sine``: a force without harmonics. ``fundamental`` or ``rms``: that of
        a force with the harmonics that the exciter causes, or that were recorded with a nonlinear mode. The default is
        ``pure-sine`` for a PNLSS or structured model of a force without ``exciter``, else ``fundamental``.
    exciter
        For PNLSS and structured models of a force: the exciter that applies it and moves with the drive point.
    held_inputs
        For PNLSS models: constant value of every input other than the driven one, by name, such as ``{"constant": 1.0}``
        after `Experiment.with_constant_input`.
    support
        For structured models: whether the support holds the mean position. By default it does with an ``exciter``.
    linear_modes
        For nonlinear modes: linear modes that give the other channels (the shape of the tested mode, scaled by the response of
        the drive point) and the contribution of the other modes.
    residuals
        For nonlinear modes: whether to add the linear response of the other modes of ``linear_modes``; true by default.
    lowest_share
        For nonlinear modes: modal amplitude at both ends of the main branch over its largest; 0.05 by default.
    band_hz
        Lowest and highest frequency for PNLSS and structured models; in place of either, None is 15 % from the resonance of
        small vibrations that moves the drive point most. A nonlinear mode answers around its own resonance.
    harmonics, samples
        For PNLSS and structured models: number of harmonics without the static one, reduced with a note if the sample rate
        has no room for them; and of samples of a period, by default enough that harmonics do not alias.
    stability
        For PNLSS and structured models: whether the multipliers of each vibration are found, which takes half of the time;
        otherwise only what lies between the folds of a frequency response counts as unstable. True by default.
    points
        Largest number of points on a branch.
    largest_range_use
        Largest amplitude, state or displacement over the largest in the data of the identification. A path that exceeds it
        ends there, with a note; a nonlinear mode refuses. ``inf`` allows any extrapolation.
    """
    found = dynamic_model(model)
    return found.frequency_response(*_request(found, force_n, ResponseOptions, options))


@formerly
def steady_predictions(
    model: object, forces_n: Sequence[float], **options: Unpack[ResponseOptions]
) -> tuple[SteadyPrediction, ...]:
    """Predict the `frequency_response` at several forces; the message of an error names the force.

    Parameters
    ----------
    model
        A model of any kind that has steady states.
    forces_n
        Peak forces of the fundamental, N.
    options
        The further parameters of `frequency_response`.
    """
    return tuple(frequency_response(model, force_n, **options) for force_n in forces_n)


@formerly
def response_band(
    model: object,
    force_n: float,
    *,
    force: Held | None = None,
    exciter: Exciter | None = None,
    draws: int = 200,
    seed: int = 0,
    largest_range_use: float = LARGEST_RANGE_USE,
) -> ResponseBand:
    """Propagate the errors of a model to a predicted response, by Monte Carlo.

    The band of a structured model also holds the error that its fit left, and laws that the training data leave open beyond
    their range (`identification.models.structured.alternatives`).

    Raises `IdentificationError` if the model has no standard errors, or ``draws`` is below 20, and `ExtrapolationError` if
    these laws differ too much or the force of a structured model is above twice that of its training data.

    Parameters
    ----------
    model
        A `NonlinearMode` with standard errors of frequency and damping, or a `StructuredFit`.
    force_n, force, exciter, largest_range_use
        As for `frequency_response`.
    draws
        Number of draws, at least 20.
    seed
        Seed of the random numbers.
    """
    IdentificationError.unless_at_least("draws", draws, 20)
    found = dynamic_model(model)

    def respond(one: object, largest: float = _ANY_RANGE) -> SteadyPrediction:
        drawn = dynamic_model(one)
        options = {"force": force, "exciter": exciter, "points": found.band_points, "largest_range_use": largest}
        request, band_hz = _request(drawn, force_n, ResponseOptions, options)
        return drawn.frequency_response(replace(request, stability=False), band_hz)  # a band has no use for it

    band = band_of_responses(respond(one, largest_range_use) for one in found.draws(draws, seed))
    return found.with_what_is_open(band, respond(model, largest_range_use), respond)


def harmonic_response(
    model: object, force_n: float | None = None, **options: Unpack[HarmonicOptions]
) -> HarmonicResponse:
    """Predict the steady response with all harmonics.

    PNLSS and structured models answer, by harmonic balance and arc-length continuation through folds. ``states`` of a
    structured model are its modal coordinates, ``state_use`` is the largest displacement of each element over its largest in
    the training data, and the multipliers are those over a period; its stability does not consider the memory of the
    support's filter.

    Parameters
    ----------
    model
        A model with harmonics: PNLSS or structured.
    force_n
        Peak force of the fundamental, N.
    options
        The further parameters of `frequency_response`, whose errors are raised.
    """
    found = dynamic_model(model)
    return found.harmonic_response(*_request(found, force_n, HarmonicOptions, options))


def steady_state(
    model: object,
    frequency_hz: float,
    force_n: float | None = None,
    *,
    voltage_v: float | None = None,
    near: SteadyStates | None = None,
    **options: Unpack[StateOptions],
) -> SteadyStates:
    """Compute the periodic vibration at one frequency and level: reached from rest as the level rises, or ``near`` another.

    Parameters
    ----------
    model
        A model of any kind that has steady states.
    frequency_hz
        Frequency of the vibration, Hz.
    force_n
        Peak force of the fundamental, N; or give ``voltage_v``.
    voltage_v
        Peak voltage of the exciter, V.
    near
        A vibration, at whose first point the search begins. It may then exceed ``largest_range_use``.
    options
        The further parameters of `frequency_response`, whose errors are raised.
    """
    found = dynamic_model(model)
    request, _ = _request(found, force_n, StateOptions, options, voltage_v)
    return found.steady_state(request, frequency_hz, near)


def backbone(
    model: object, force_n: float, *, near_hz: float | None = None, **options: Unpack[BackboneOptions]
) -> SteadyStates:
    """Compute the vibrations at phase resonance from 2 % of a force up to this force, as a backbone test measures them.

    Parameters
    ----------
    model
        A model of any kind that has steady states.
    force_n
        Largest peak force of the fundamental, N.
    near_hz
        The backbone begins at the mode of small vibrations nearest to this frequency, Hz; by default at that which moves
        the drive point most.
    options
        The further parameters of `frequency_response`.
    """
    found = dynamic_model(model)
    return found.backbone(_request(found, force_n, BackboneOptions, options)[0], near_hz)


def coupled_run(model: object, exciter: Exciter, voltage_v: ArrayLike, *, lowest_hz: float | None = None) -> Simulation:
    """Simulate a model with the exciter at its force input, both from rest, under a recorded voltage.

    Raises `IdentificationError` if values are NaN or infinite, the model lacks these channels, or no stable filter for the
    reaction is found.

    Parameters
    ----------
    model
        PNLSS or structured model with one force as its only input, and the drive-point motion among its outputs.
    exciter
        Exciter identified on the same rig. It applies no static force; that of its suspension is a structured model's support.
    voltage_v
        float[n], recorded voltage at the model's sample rate. Do not correct it for the voltage path, which the exciter's
        ``path`` models.
    lowest_hz
        Frequency above which the exciter's reaction is exact; below it the reaction fades. Default: 0.8 times the lowest
        frequency of a PNLSS model's training; if that is unknown, and for structured models, half the resonance of small
        vibrations.
    """
    return dynamic_model(model).coupled_run(exciter, voltage_v, lowest_hz)


def _request(
    model: DynamicModel, force_n: float | None, allowed: Any, options: Any, voltage_v: float | None = None
) -> tuple[SteadyRequest, Band]:
    """Return what is asked, and the band; raise `IdentificationError` for an option that the kind of model does not have."""
    if unknown := options.keys() - allowed.__optional_keys__:
        raise TypeError(f"got an unexpected keyword argument '{min(unknown)}'")
    given = {name: value for name, value in {"voltage_v": voltage_v, **options}.items() if value is not None}
    for name in given:
        if name not in model.options | _COMMON:
            raise IdentificationError(f"does not apply to a {model.kind}; leave it out", field=name)
    force, voltage, band = given.pop("force", None), given.pop("voltage_v", None), given.pop("band_hz", (None, None))
    if force == "voltage":
        raise IdentificationError(
            field="force",
            value=force,
            allowed=("pure-sine", "fundamental", "rms"),
            hint="the amplitude of a voltage is `voltage_v`",
        )
    if (force_n is None) == (voltage is None):
        raise IdentificationError("force_n, voltage_v: give one of them")
    if voltage is not None and force is not None:
        raise IdentificationError(f"is '{force}', which says nothing of a voltage; leave it out", field="force")
    if force_n is None:
        return SteadyRequest(level=voltage, held="voltage", **given), band
    return SteadyRequest(level=force_n, held=force or model.default_held(given.get("exciter")), **given), band
