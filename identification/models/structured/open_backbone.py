"""Errors of backbones beyond the training data, with what these leave open there."""

from collections.abc import Callable
from typing import NamedTuple, Self

import numpy as np

from identification.errors import IdentificationError
from identification.harmonic_balance.paths import Resonances
from identification.models.structured.alternatives import alternatives
from identification.models.structured.extrapolation import AMPLITUDE, FREQUENCY
from identification.models.structured.fit import StructuredFit
from identification.models.structured.model import StructuredModel
from identification.models.structured.open_quantities import check_input, grown, refused
from identification.models.structured.trained_range import trained_force_n
from vibrolock.arrays import Float

_SPANS = np.log([[1.2], [3.0]])
"""Upper ends of the intervals of frequency and damping over the lower ends, above which a backbone is refused. Chosen."""
_FURTHER, _TRIES = 1.5, 5
"""Factor by which the force rises until another model moves as far, and most tries. Chosen."""
_TWO_SIDED_95 = 1.96


class BackboneCurve(NamedTuple):
    """A backbone: vibrations at phase resonance over the force."""

    force_n: Float
    """float[n], peak of the fundamental."""
    frequency_hz: Float
    amplitude_m: Float
    """float[n], of the drive point."""

    @classmethod
    def of(cls, path: Resonances) -> Self:
        """Return that of a path of resonances."""
        states = path.states(stability=False)
        drive = states.displacement_m[:, 1, 0]
        return cls(np.abs(states.force_n[:, 1]), np.asarray(path.frequency_hz), np.abs(drive))

    def properties(self, amplitude_m: Float) -> Float:
        """float[2, n]: logarithms of the frequency, and of damping up to a factor, at amplitudes up to its largest."""
        top = int(np.argmax(self.amplitude_m)) + 1
        power = self.force_n / (self.frequency_hz**2 * self.amplitude_m)
        return np.array(
            [np.interp(amplitude_m, self.amplitude_m[:top], np.log(row[:top])) for row in (self.frequency_hz, power)]
        )


def with_open_laws(
    fit: StructuredFit,
    own: BackboneCurve,
    relative: Float,
    backbone: Callable[[StructuredModel, float], BackboneCurve],
) -> Float:
    """float[2, n]: standard errors of frequency and damping ratio at each amplitude, relative, with what is open.

    Those of symmetric 95 % intervals that hold it, where the force is above that of the training data; below, ``relative``.
    Raises `ExtrapolationError` for a force above twice that of the training data, and where laws that fit these data as well
    differ too much or have no such backbone.

    Parameters
    ----------
    fit
        The fit.
    own
        Backbone of its model.
    relative
        float[2, n], standard errors by the covariance of the fit.
    backbone
        Gives the backbone of another model up to a force.
    """
    hz = own.frequency_hz
    use = own.force_n / trained_force_n(fit.model, 0.5 * float(hz.min()), 2.0 * float(hz.max()))
    if not use[-1] > 1.0:
        return relative
    name = f"backbone up to {own.force_n[-1]:.3g} N"
    check_input(name, float(use[-1]))
    at_rest = fit.model.linearised()
    damping = float(at_rest.damping_ratio[np.argmin(np.abs(at_rest.frequency_hz - hz[0]))])
    here = own.properties(own.amplitude_m)
    damping_ratio = damping * np.exp(here[1] - here[1, 0])
    error = (
        fit.training_error
        * np.array(
            [[grown(FREQUENCY, one) * z, grown(AMPLITUDE, one)] for one, z in zip(use, damping_ratio, strict=True)]
        ).T
    )
    up = _TWO_SIDED_95 * relative + error
    down = up.copy()
    families: dict[str, list[Float]] = {}
    for family, model in alternatives(fit.model):
        try:
            families.setdefault(family, []).append(_properties(model, own, backbone) - here)
        except IdentificationError:
            raise refused(name, float(use[-1]), f"a {family} that fits these data as well has none") from None
    for moved in families.values():
        up, down = up + np.maximum(np.max(moved, axis=0), 0.0), down - np.minimum(np.min(moved, axis=0), 0.0)
    if np.any((up + down > _SPANS) & (use > 1.0)):
        raise refused(name, float(use[-1]), "models that fit these data as well differ too much there")
    return np.where(use > 1.0, np.maximum(up, down) / _TWO_SIDED_95, relative)


def _properties(
    model: StructuredModel, own: BackboneCurve, backbone: Callable[[StructuredModel, float], BackboneCurve]
) -> Float:
    force_n = float(own.force_n[-1])
    for _ in range(_TRIES):
        found = backbone(model, force_n)
        if np.max(found.amplitude_m) >= own.amplitude_m[-1]:
            return found.properties(own.amplitude_m)
        force_n *= _FURTHER
    raise IdentificationError("the backbone ends below", field="amplitude")
