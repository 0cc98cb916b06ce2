"""Answers of a nonlinear mode to what is asked of any dynamic model.

Modes are drawn by their standard errors: modal frequencies and damping ratios about their values, independently at each level.
An error of the mass-normalised drive shape is common to all levels and cancels at the drive point: q, phi_d and z change so
that the predicted displacement per force remains the same.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from identification.channels import Channel
from identification.errors import IdentificationError
from identification.exciter_coupling.exciter import Exciter
from identification.harmonic_balance.setting_up import Held
from identification.harmonic_balance.stability import Loss
from identification.harmonic_balance.states import SteadyStates
from identification.models.dynamic_model import DynamicModel, Limit, SteadyRequest
from identification.models.modal.frequency_response import FARTHEST, fundamental_of, mode_response
from identification.models.modal.properties import ModalProperties
from identification.models.modal.steady_states import OneMode, fundamental_motion, modal_stiffness
from identification.nonlinear.nonlinear_modes import NonlinearMode
from identification.prediction.steady_prediction import SteadyPrediction
from identification.validation import positive
from vibrolock.arrays import Complex, Float

_FORCE, _DRIVE = Channel("force", "force", "N"), Channel("drive", "drive", "m")
_FIRST_LEVEL = 0.02
"""Share of the force at which a backbone begins, as for models by harmonic balance. Chosen."""
_GRID = 4000
"""Amplitudes among which the end of a backbone is sought. Chosen: properties are smooth cubics between levels."""
_BACKBONE_POINTS = 100
"""Largest number of points of a backbone, which are evenly spaced in amplitude. Chosen."""


class ModalDynamics(DynamicModel):
    """A nonlinear mode: the fundamental of the motion at the drive point, under a force."""

    kind = "nonlinear mode"
    options = frozenset({"linear_modes", "residuals", "lowest_share"})
    channels = (_DRIVE.name,)
    band_points = 121

    def __init__(self, mode: NonlinearMode) -> None:
        self.mode = mode

    def default_held(self, exciter: Exciter | None) -> Held:
        """Return the fundamental of a force with the harmonics that were recorded."""
        return "fundamental"

    def linear_response(self, frequency_hz: Float) -> Complex:
        """Return the response with the properties of the lowest level."""
        properties, omega = ModalProperties.of(self.mode), 2.0 * np.pi * np.asarray(frequency_hz)
        rest = np.zeros(omega.shape)
        shape = properties.drive_shape(rest)
        return np.asarray(shape**2 / modal_stiffness(properties, rest, omega))[:, None]

    def validity(self) -> tuple[Limit, ...]:
        """Return the largest modal amplitude."""
        return (Limit("modal amplitude", ModalProperties.of(self.mode).q_range[1], "kg^1/2 m"),)

    def frequency_response(
        self, request: SteadyRequest, band_hz: tuple[float | None, float | None]
    ) -> SteadyPrediction:
        """Return the response on all branches, around the resonance."""
        return mode_response(self.mode, request)

    def steady_state(self, request: SteadyRequest, frequency_hz: float, near: SteadyStates | None) -> SteadyStates:
        """Return the smallest vibration, to which rest leads as the force rises, or that nearest to another."""
        omega = 2.0 * np.pi * positive("frequency_hz", frequency_hz, "Hz")
        one, limit = self._one(request)
        found = one.amplitudes(omega, limit)
        if not found.size:
            raise IdentificationError(
                f"frequency_hz: no periodic vibration was found at {frequency_hz:g} Hz and {request.level:g} N"
            )
        q = found[0] if near is None else found[np.argmin(np.abs(found - abs(complex(near.states[0, 1, 0]))))]
        return self._states(one, np.array([q]), np.array([omega]))

    def backbone(self, request: SteadyRequest, near_hz: float | None) -> SteadyStates:
        """Return vibrations at the modal frequency, evenly spaced in amplitude."""
        one, limit = self._one(request)
        q = limit * np.arange(1, _GRID + 1) / _GRID
        w, z = one.properties.frequency_rad_s(q), one.properties.damping_ratio(q)
        level = 2.0 * w**2 * z * q / one.modal_force(q)
        beyond = np.flatnonzero(level >= 1.0)
        if not beyond.size:
            reached = float(level[-1]) * request.level
            raise IdentificationError(f"force_n: the backbone ends at {reached:.3g} N (the largest amplitude allowed)")
        first, last = np.interp((_FIRST_LEVEL, 1.0), level[: beyond[0] + 1], q[: beyond[0] + 1]).tolist()
        q = np.linspace(first, last, min(request.points, _BACKBONE_POINTS))
        w, z = one.properties.frequency_rad_s(q), one.properties.damping_ratio(q)
        level = 2.0 * w**2 * z * q / one.modal_force(q)
        return self._states(one, q, w, level)

    def draws(self, count: int, seed: int) -> Iterator["ModalDynamics"]:
        """Yield modes with frequencies and damping ratios drawn by their standard errors."""
        for mode in drawn_modes(self.mode, count, seed):
            yield ModalDynamics(mode)

    def _one(self, request: SteadyRequest) -> tuple[OneMode, float]:
        properties = ModalProperties.of(
            self.mode,
            damping="total-power" if request.held == "pure-sine" else "fundamental",
            largest_range_use=request.largest_range_use,
        )
        level = positive("force_n", request.level, "N")
        one = OneMode(properties, fundamental_of(self.mode, level, request.held))
        return one, min(properties.highest_q, FARTHEST * properties.q_range[1])

    def _states(self, one: OneMode, q: Float, omega: Float, level: Float | float = 1.0) -> SteadyStates:
        """Return vibrations with amplitudes and frequencies (rad/s), under shares ``level`` of the force."""
        force = one.fundamental_n(q) * level
        motion = fundamental_motion(self.mode, one.properties, q, omega, force, None, False)[1][:, 0]
        trace, determinant = one.jacobian(q, omega)
        root = np.sqrt(np.asarray(trace**2 / 4.0 - determinant, dtype=np.complex128))
        rates = np.column_stack([trace / 2.0 + root, trace / 2.0 - root])
        loss: list[Loss] = [
            "fold" if d <= 0.0 else "" if t < 0.0 else "Neimark-Sacker" for t, d in zip(trace, determinant, strict=True)
        ]

        def harmonics(fundamental: Complex | Float) -> Complex:
            return np.stack([np.zeros(q.size), fundamental], axis=1)[:, :, None].astype(np.complex128)

        return SteadyStates(
            frequency_hz=omega / (2.0 * np.pi),
            states=harmonics(q * np.exp(1j * np.angle(motion))),
            inputs=harmonics(force),
            outputs=harmonics(motion),
            voltage_v=np.full(q.size, np.nan, dtype=np.complex128),
            multipliers=np.exp(rates * (2.0 * np.pi / omega)[:, None]),
            stable=one.stable(q, omega),
            loss=tuple(loss),
            state_use=one.properties.range_use(q)[:, None],
            input_use=np.full((q.size, 1), np.nan),
            input_channels=(_FORCE,),
            output_channels=(_DRIVE,),
        )


_LEAST_SHARE = 0.05
"""Least damping ratio of a draw over its value. Chosen."""


def drawn_modes(mode: NonlinearMode, count: int, seed: int) -> Iterator[NonlinearMode]:
    """Yield ``count`` draws of the mode; raise `IdentificationError` if a level has no standard error."""
    for name in ("modal_frequency_std_hz", "damping_ratio_std"):
        if not np.all(np.isfinite(getattr(mode, name))):
            raise IdentificationError("unknown at some level, the band needs it", field=name)
    random = np.random.default_rng(seed)
    for _ in range(count):
        yield _drawn(mode, random)


def _drawn(mode: NonlinearMode, random: np.random.Generator) -> NonlinearMode:
    """Return one draw of the mode; damping ratios stay above a twentieth of their value."""
    levels = mode.force_n.size
    moved = mode.damping_ratio_std * random.standard_normal(levels)
    return replace(
        mode,
        modal_frequency_hz=mode.modal_frequency_hz + mode.modal_frequency_std_hz * random.standard_normal(levels),
        damping_ratio=np.maximum(mode.damping_ratio + moved, _LEAST_SHARE * mode.damping_ratio),
        damping_ratio_total_power=np.maximum(
            mode.damping_ratio_total_power + moved, _LEAST_SHARE * mode.damping_ratio_total_power
        ),
    )
