"""Scatter of a specimen: from run to run, and from one assembly of it to the next.

Modal frequencies and damping vary from run to run (temperature, fixture); joints and magnets vary each time the specimen is
assembled. The first are drawn from the seed of the run, the second from the number of the assembly, so that the same seed and
assembly give the same rig. Every quantity has its own random numbers: scattering a further quantity does not change the others.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from simulators.part import Part, Several
from simulators.plant.assembly import LinearPlant
from vibrolock.errors import InputError

Relative = Annotated[float, Field(ge=0.0, le=0.3)]
AboveMinusOne = Annotated[float, Field(gt=-1.0)]
Drawn = TypeVar("Drawn", bound=Part)

_RUN, _ASSEMBLY = 1, 2  # random streams; the noise uses the seed without a stream
_STIFFNESS_FIELDS = ("stiffness", "stiffness_n_m")
_SLIP_FIELDS = ("slip", "phi_max_m")


class Deviation(Part):
    """By how much this very specimen deviates from its model, mode by mode."""

    frequency: Several[AboveMinusOne] = ()
    """Relative deviation of each natural frequency of the structure (without magnets, joints stuck); empty for none."""
    damping: Several[AboveMinusOne] = ()
    """Relative deviation of each modal damping ratio; empty for none."""

    def combined(self, frequency: NDArray[np.float64], damping: NDArray[np.float64]) -> "Deviation":
        """Return the deviation that results from further factors [n_mode] on frequencies and damping ratios."""
        first = [np.array(own) if own else np.zeros(frequency.size) for own in (self.frequency, self.damping)]
        factors = [(1.0 + own) * factor - 1.0 for own, factor in zip(first, (frequency, damping), strict=True)]
        return Deviation(frequency=tuple(factors[0].tolist()), damping=tuple(factors[1].tolist()))


class Scatter(Part):
    """Relative standard deviations; what scatters is multiplied by ``exp(s z)`` with a standard normal z each."""

    frequency: Relative = 0.0
    """Relative standard deviation of each natural frequency of the structure, from run to run."""
    damping: Relative = 0.0
    """Relative standard deviation of each modal damping ratio, from run to run."""
    assembly: Annotated[int, Field(ge=0)] = 0
    """Which assembly of the specimen this is; 0 is the nominal one."""
    joint_stiffness: Relative = 0.0
    """Relative standard deviation of the stiffness of each friction joint, from assembly to assembly."""
    joint_slip: Relative = 0.0
    """Relative standard deviation of the slip deflections of each friction joint, from assembly to assembly."""
    magnet_strength: Relative = 0.0
    """Relative standard deviation of the constant of each magnet, from assembly to assembly."""
    magnet_gap: Relative = 0.0
    """Relative standard deviation of the gap of each magnet, from assembly to assembly."""

    @property
    def run_scatters(self) -> bool:
        """Whether runs of the same assembly differ."""
        return self.frequency > 0.0 or self.damping > 0.0

    @property
    def assembly_scatters(self) -> bool:
        """Whether this assembly differs from the nominal one."""
        sizes = (self.joint_stiffness, self.joint_slip, self.magnet_strength, self.magnet_gap)
        return self.assembly > 0 and any(size > 0.0 for size in sizes)

    def modal_factors(self, seed: int, n_mode: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return factors [n_mode] on the natural frequencies and on the damping ratios of a run."""
        z = _numbers(seed, _RUN, n_mode)
        return np.exp(self.frequency * z[0]), np.exp(self.damping * z[1])

    def joints(self, nominal: Sequence[Drawn]) -> tuple[Drawn, ...]:
        """Return the friction joints of this assembly."""
        z = _numbers(self.assembly, _ASSEMBLY, len(nominal))
        stiffness, slip = np.exp(self.joint_stiffness * z[0]), np.exp(self.joint_slip * z[1])
        return tuple(
            _scaled(joint, dict.fromkeys(_STIFFNESS_FIELDS, float(k)) | dict.fromkeys(_SLIP_FIELDS, float(s)))
            for joint, k, s in zip(nominal, stiffness, slip, strict=True)
        )

    def magnets(self, nominal: Sequence[Drawn]) -> tuple[Drawn, ...]:
        """Return the magnets of this assembly."""
        z = _numbers(self.assembly, _ASSEMBLY, len(nominal))
        strength, gap = np.exp(self.magnet_strength * z[2]), np.exp(self.magnet_gap * z[3])
        return tuple(
            _scaled(magnet, {"strength_n_m4": float(k), "gap_m": float(d)})
            for magnet, k, d in zip(nominal, strength, gap, strict=True)
        )


def deviated(plant: LinearPlant, omega_rad_s: NDArray[np.float64], deviation: Deviation) -> LinearPlant:
    """Return the plant with the structure's frequencies ``omega_rad_s`` [n_mode] and damping ratios changed by a deviation.

    ``w_i^2`` becomes ``(w_i (1 + e_i))^2``, and ``2 zeta_i w_i`` becomes ``2 zeta_i (1 + d_i) w_i (1 + e_i)``. The contribution
    of the magnets does not change. Raises `ValueError` if the deviation has another number of modes.
    """
    if not (deviation.frequency or deviation.damping):
        return plant
    m = plant.n_mode
    moves = []
    for name, values in (("frequency", deviation.frequency), ("damping", deviation.damping)):
        if len(values) not in (0, m):
            reason = f"has {len(values)} values"
            raise InputError(reason, field=f"deviation.{name}", allowed=f"{m}, one per mode, or none")
        moves.append(1.0 + (np.array(values) if values else np.zeros(m)))
    frequency, damping = moves
    stiffer = omega_rad_s**2 * (frequency**2 - 1.0)
    damped = plant.modal_damping * (frequency * damping - 1.0)
    dynamics = plant.dynamics.copy()
    modes = np.arange(m)
    dynamics[m + modes, modes] -= stiffer
    dynamics[m + modes, m + modes] -= damped
    return replace(
        plant,
        dynamics=dynamics,
        modal_stiffness=plant.modal_stiffness + np.diag(stiffer),
        modal_damping=plant.modal_damping + damped,
    )


def _numbers(entropy: int, stream: int, n: int) -> NDArray[np.float64]:
    """Return standard normal numbers [4, n]; the numbers of an item do not depend on how many items follow."""
    generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence(entropy, spawn_key=(stream,))))
    return generator.standard_normal((n, 4)).T


def _scaled(part: Drawn, factors: dict[str, float]) -> Drawn:
    """Return a part whose fields are multiplied by their factor, where ``factors`` has one."""
    table = part.model_dump()
    for name, factor in factors.items():
        if name in table:
            value = table[name]
            table[name] = [factor * item for item in value] if isinstance(value, list | tuple) else factor * value
    return type(part).model_validate(table)
