"""Read recordings as measurements in memory, in the form that `identification` takes."""

from collections.abc import Collection
from pathlib import Path
from typing import cast

from identification import (
    Backbone,
    ContinuousBackbone,
    DecayBackbone,
    ForceSurface,
    FrequencyResponse,
    FrequencyResponseMatrix,
    PeriodicSpectra,
    Transient,
    force_surface as surface_of,
)
from identification.common import Estimator
from rig.campaigns.dwell.points import DwellCourse
from rig.campaigns.kinds import KINDS, kinds_that_yield
from rig.errors import RecordingError
from rig.recording.reader import Recording

STEPPED = kinds_that_yield(FrequencyResponse)
"""Kinds of recordings that hold frequency responses, one per level."""


def backbone(recording: Recording) -> Backbone:
    """Return the accepted points of a backbone recording that belong to the current plan, in the order of the plan.

    For a continuous backbone these are the means of up and down, without the differences between them (see
    `continuous_backbones`).
    """
    return cast(Backbone, _measured(recording, Backbone))


def continuous_backbones(recording: Recording) -> tuple[ContinuousBackbone, ...]:
    """Return the accepted points of a continuous backbone, one backbone per repeat, with the results up and down."""
    return cast(tuple[ContinuousBackbone, ...], _measured(recording, ContinuousBackbone))


def decays(recording: Recording) -> dict[int, DecayBackbone]:
    """Return the decay of every accepted point of a decay recording, by the stored number of its point, which counts from 0.

    The exciter's part is taken out through the measured force; times count from the release.
    """
    return cast(dict[int, DecayBackbone], _measured(recording, DecayBackbone))


def frequency_responses(recording: Recording) -> tuple[FrequencyResponse, ...]:
    """Return the fundamentals of force and drive of a stepped-sine, stepped-phase or response-controlled recording.

    There is one response per level and pass, with its accepted points in the order of measurement; for stepped phase this is
    the order along the branch.
    """
    return cast(tuple[FrequencyResponse, ...], _measured(recording, FrequencyResponse))


def dwell_course(recording: Recording) -> DwellCourse:
    """Return frequency, damping, amplitude and force of every accepted mean of a dwell, over cycles and time."""
    return cast(DwellCourse, _measured(recording, DwellCourse))


def force_surface(recording: Recording) -> ForceSurface:
    """Return the force over frequency and displacement, from the levels of a response-controlled or stepped-sine recording.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` if the levels are not held
    displacements or if there are fewer than three.
    """
    return surface_of(frequency_responses(recording))


def sweeps(recording: Recording, *, roles: Collection[str] | None = None) -> dict[int, Transient]:
    """Return the fundamentals over time of every accepted sweep, by the stored number of its point, which counts from 0.

    The output is channel ``voltage``.

    Parameters
    ----------
    recording
        Recording of a sweep.
    roles
        Roles of the channels that are wanted, the force's among them; all if None.
    """
    options = {} if roles is None else {"roles": roles}
    return cast(dict[int, Transient], _measured(recording, Transient, **options))


def spectra(recording: Recording) -> dict[float, PeriodicSpectra]:
    """Return the spectra of every accepted realisation, by level (V RMS). The output is channel ``voltage``."""
    return cast(dict[float, PeriodicSpectra], _measured(recording, PeriodicSpectra))


def response_matrices(
    recording: Recording, *, estimator: Estimator = "instrument"
) -> dict[float, FrequencyResponseMatrix]:
    """Return the frequency responses from the force to every motion, by level (V RMS), with their covariance.

    Parameters
    ----------
    recording
        Recording of a multisine or modal test.
    estimator
        ``instrument`` (the voltage is the instrument), ``H1``, ``H2`` or ``Hv``.
    """
    found = _measured(recording, FrequencyResponseMatrix, estimator=estimator)
    return cast(dict[float, FrequencyResponseMatrix], found)


def load_backbone(path: Path) -> Backbone:
    """Return the `backbone` in a file."""
    with Recording(path) as recording:
        return backbone(recording)


def _measured(recording: Recording, measurement: type, **options: object) -> object:
    campaign = KINDS.get(recording.kind)
    if campaign is None or measurement not in campaign.measurements:
        wanted = " or a ".join(kinds_that_yield(measurement))
        raise RecordingError(f"the recording is a {recording.kind}, expected a {wanted}")
    return campaign.measurements[measurement](recording, **options)
