"""A virtual rig: structure, elements, joints, exciter, stinger, sensors and converters, from a table to compiled arrays."""

from collections.abc import Iterator
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from simulators.exciter import Exciter, Stinger
from simulators.layout import RigArrays, RigState
from simulators.modes import LinearModes, coupled_modes, structure_modes
from simulators.part import Part, Several
from simulators.plant.assembly import LinearPlant, assemble, check_elements, check_plant, computable, steps_per_sample
from simulators.plant.compilation import at_rest, rediscretised, rig_arrays
from simulators.scatter import Deviation, Scatter, deviated
from simulators.sensing.filters import channel_delays, filter_delay
from simulators.sensing.parts import Converter, Sensor
from simulators.shipped import specimen_table, with_parts_of
from simulators.sites.elements import Element, Magnet
from simulators.sites.friction import FrictionSite
from simulators.structures.structure import ModalStructure, Structure
from simulators.wear import Wear
from vibrolock.errors import InputError

_OPEN, _LOOSE_N_M = 1e4, 1e-6  # factor of an open circuit's resistance; N/m, stiffness of a detached stinger; chosen


class VirtualRig(Part):
    """Everything a virtual rig is; `build` turns it into the arrays that `simulators.stepping.sample` runs on.

    ``VirtualRig.shipped("magnet-beam")`` is a shipped one, ``{"specimen": "magnet-beam"}`` the same as a table. Further
    tables change it key by key: ``VirtualRig.shipped("magnet-beam", converter={"substeps": 4})``; a list is replaced
    whole. Without ``specimen`` all parts are given.
    """

    specimen: str | None = None
    """Shipped specimen that the other tables change: magnet-beam, magnet-beam-symmetric or friction-beam."""
    provenance: dict[str, str] = Field(default_factory=dict)
    """Which of the numbers are published, calibrated, chosen or unverified; for the record."""
    structure: Structure
    """The vibrating structure."""
    elements: Several[Element] = ()
    """Local nonlinear elements without memory: magnets, springs, stops, functions of the user's own."""
    friction: Several[FrictionSite] = ()
    """Friction joints."""
    exciter: Exciter
    """The shaker and its amplifier."""
    stinger: Stinger
    """The rod between exciter and structure."""
    sensors: Annotated[Several[Sensor], Field(min_length=1)]
    """One channel per sensor, in this order."""
    converter: Converter = Converter()
    """Sampling and converters."""
    deviation: Deviation = Deviation()
    """By how much the modes of this specimen deviate from those of its structure."""
    scatter: Scatter = Scatter()
    """How specimens differ from run to run and from assembly to assembly; nothing scatters by default."""
    wear: Wear = Wear()
    """How the modes of the specimen change within a run; nothing does by default."""
    noise_scale: Annotated[float, Field(ge=0.0)] = 1.0
    """Factor on the noise of every sensor; 0 for none."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of noise and scatter."""

    @classmethod
    def shipped(cls, specimen: str, **changes: Any) -> "VirtualRig":
        """Return a shipped specimen with changes by table or value; raise `pydantic.ValidationError` if they are invalid."""
        return cls.model_validate({"specimen": specimen, **changes})

    @model_validator(mode="before")
    @classmethod
    def _from_specimen(cls, table: Any) -> Any:
        if isinstance(table, dict) and isinstance(table.get("specimen"), str):
            return with_parts_of(specimen_table(table["specimen"]), table)
        return table

    @model_validator(mode="after")
    def _belongs_together(self) -> "VirtualRig":
        with computable("structure, friction"):
            self._check_points()
        names = self.channel_names
        if twice := [name for name in names if names.count(name) > 1]:
            raise InputError(f"two are named {twice[0]!r}", field="sensors", allowed="one of each name")
        with computable("structure"):
            moves = np.any(self.structure.shape(self.stinger.at))
        InputError.raise_if(not moves, field="stinger.at", value=self.stinger.at, allowed="a point that moves")
        with computable("structure, elements, friction, exciter, stinger"):
            check_elements(self.elements, self.plant)
            check_plant(self.plant)
            self._check_joints(self.plant)
            _ = self.substeps
            self._check_wear()
        self._check_low_passes()
        return self

    def _check_points(self) -> None:
        points = self.structure.points
        used = {f"elements[{i}].at": element.at for i, element in enumerate(self.elements)}
        used |= {f"elements[{i}].to": element.to for i, element in enumerate(self.elements) if element.to is not None}
        used |= {f"friction[{i}].at": joint.at for i, joint in enumerate(self.friction)}
        used |= {"stinger.at": self.stinger.at}
        used |= {f"sensors[{i}].at": sensor.at for i, sensor in enumerate(self.sensors) if sensor.at is not None}
        for path, at in used.items():
            InputError.unless_one_of(path, at, points)
        for i, joint in enumerate(self.friction):
            if isinstance(self.structure, ModalStructure) and joint.quantity != "deflection":
                allowed = "'deflection' where the modes are given"
                raise InputError(field=f"friction[{i}].quantity", value=joint.quantity, allowed=allowed)
            if joint.relative_to_mode_1 and self.structure.shape(joint.at, joint.quantity)[0] == 0.0:
                raise InputError(field=f"friction[{i}].at", value=joint.at, allowed="a coordinate that mode 1 moves")

    def _check_joints(self, plant: LinearPlant) -> None:
        """Raise `ValueError` if joints are stiffer than their structure, which would be unstable while they slip."""
        slipping = plant.modal_stiffness.copy()
        for joint, row in zip(self.friction, plant.site_rows[plant.n_local :], strict=True):
            coordinate = row[: plant.n_mode]
            slipping -= joint.stuck_stiffness * np.outer(coordinate, coordinate)
        lowest = np.linalg.eigvalsh(slipping)[0]
        if lowest < -1e-9 * np.max(np.abs(plant.modal_stiffness)):
            total = sum(joint.stuck_stiffness for joint in self.friction)
            reason = f"stiffness {total:.6g} in all"
            raise InputError(reason, field="friction", allowed="less than the structure has there")

    def _check_wear(self) -> None:
        """Raise `ValueError` if wear is for another number of modes, has steps below a sample, or ends in an invalid rig."""
        self._worn_deviation(0.0)
        if self.wear.every_s * self.converter.sample_rate_hz < 1.0:
            shortest_s = 1.0 / self.converter.sample_rate_hz
            raise InputError(field="wear.every_s", value=self.wear.every_s, allowed=f"from {shortest_s:g}, one sample")
        if self.wear.wears and self.wear.until_s is not None:
            worn = self._worn_plant(self.wear.until_s)
            try:
                check_plant(worn)
                self._check_joints(worn)
            except ValueError as error:
                raise InputError(f"then {error}, or less wear", field="wear.until_s", value=self.wear.until_s) from None

    def _check_low_passes(self) -> None:
        half_hz = 0.5 * self.converter.internal_rate_hz
        for i, sensor in enumerate(self.sensors):
            if sensor.low_pass_hz >= half_hz:
                allowed = f"below {half_hz:g}, half the internal rate"
                raise InputError(field=f"sensors[{i}].low_pass_hz", value=sensor.low_pass_hz, allowed=allowed)

    def build(self, seed: int | None = None) -> tuple[RigArrays, RigState]:
        """Return the kernels' arrays and a state at rest; ``seed`` of noise and scatter replaces the rig's own."""
        if self.scatters:
            return self.realised(seed).build(seed)
        rig = rig_arrays(
            self.plant,
            self.elements,
            self.friction,
            self.exciter,
            [self.output_row(sensor) for sensor in self.sensors],
            self.sensors,
            self.converter,
            substeps=self.substeps,
            noise_scale=self.noise_scale,
            seed=self.seed if seed is None else seed,
        )
        return rig, at_rest(rig)

    @property
    def scatters(self) -> bool:
        """Whether the specimen of a run differs from the nominal specimen."""
        return self.scatter.run_scatters or self.scatter.assembly_scatters

    def realised(self, seed: int | None = None) -> "VirtualRig":
        """Return the specimen of a run with this seed, in the assembly of ``scatter``; the returned rig has no scatter."""
        if not self.scatters:
            return self
        frequency, damping = self.scatter.modal_factors(self.seed if seed is None else seed, self.plant.n_mode)
        changes: dict[str, Any] = {"scatter": Scatter()}
        if self.scatter.run_scatters:
            changes["deviation"] = self.deviation.combined(frequency, damping)
        if self.scatter.assembly_scatters:
            magnets = iter(self.scatter.magnets([part for part in self.elements if isinstance(part, Magnet)]))
            changes["elements"] = [next(magnets) if isinstance(part, Magnet) else part for part in self.elements]
            changes["friction"] = self.scatter.joints(self.friction)
        return self._changed(changes)

    def worn(self, time_s: float) -> "VirtualRig":
        """Return the specimen at a time (s) of a run, without further wear: the reference for measurements at that time.

        Its plant is that of the run at the nearest sample, which is held since the last multiple of ``wear.every_s``. Raises
        `ValueError` for a time below 0.
        """
        deviation = self._worn_deviation(time_s)
        if time_s > 0.0 and self.wear.wears:
            rate_hz = self.converter.sample_rate_hz
            deviation = self._worn_deviation(self.wear.held_s(round(time_s * rate_hz), rate_hz))
        return self._changed({"deviation": deviation, "wear": Wear()})

    def released(self, how: Literal["open-circuit", "stinger-dropped"]) -> "VirtualRig":
        """Return the rig with its coil open, so that no current damps it, or with its stinger off.

        A run can go on with its arrays. An open coil has 10 000 times the resistance, a stinger that is off 1e-6 N/m.
        """
        if how == "open-circuit":
            opened = (
                {"resistance_ohm": _OPEN * self.exciter.resistance_ohm} if self.exciter.amplifier == "voltage" else {}
            )
            return self._changed({"exciter": self.exciter.model_copy(update=opened)})
        loose = {"stiffness_n_m": _LOOSE_N_M, "damping_n_s_m": 0.0}
        return self._changed({"stinger": self.stinger.model_copy(update=loose)})

    def pieces(self, arrays: RigArrays, first: int, n: int) -> Iterator[tuple[RigArrays, slice]]:
        """Split the next ``n`` samples of a run, from sample ``first`` on, into pieces during which the plant is constant.

        Yield the arrays of each piece and its slice of the n samples. ``arrays`` are those of the previous sample, or those
        built. Without wear there is one piece. For a rig with scatter, call this on the rig that `realised` returns.
        """
        if not self.wear.wears:
            yield arrays, slice(0, n)
            return
        step = self.wear.step_samples(self.converter.sample_rate_hz)
        start, stop = 0, -1
        while stop < n:
            stop = min(n, start + step - (first + start) % step)
            if (first + start) % step == 0:
                arrays = self._rediscretised(arrays, first + start)
            yield arrays, slice(start, stop)
            start = stop

    def _rediscretised(self, arrays: RigArrays, sample: int) -> RigArrays:
        """Return the arrays with the plant held from a sample on; the given arrays if the plant does not change there."""
        rate_hz = self.converter.sample_rate_hz
        time_s = self.wear.held_s(sample, rate_hz)
        if sample == 0 or time_s == self.wear.held_s(sample - 1, rate_hz):
            return arrays
        plant = self._worn_plant(time_s)
        outputs = [self._row(plant, sensor) for sensor in self.sensors]
        return rediscretised(arrays, plant, len(self.friction), outputs, 1.0 / (rate_hz * self.substeps))

    def _worn_deviation(self, time_s: float) -> Deviation:
        worn = self.wear.deviation(time_s, self._nominal_plant.n_mode, self.deviation)
        return worn if self.wear.wears else self.deviation

    def _worn_plant(self, time_s: float) -> LinearPlant:
        return deviated(self._nominal_plant, self.structure.omega_rad_s, self._worn_deviation(time_s))

    def _changed(self, changes: dict[str, Any]) -> "VirtualRig":
        return VirtualRig.model_validate({name: getattr(self, name) for name in VirtualRig.model_fields} | changes)

    def output_row(self, sensor: Sensor) -> NDArray[np.float64]:
        """Return the quantity that a sensor senses (SI), as a row over the input vector ``[x, u, f]``."""
        return self._row(self.plant, sensor)

    def _row(self, plant: LinearPlant, sensor: Sensor) -> NDArray[np.float64]:
        return plant.force_row() if sensor.at is None else plant.acceleration_row(self.shape(sensor.at))

    def shape(self, at: str) -> NDArray[np.float64]:
        """Return the mode shapes (kg^-1/2) at a named point, with signs such that the drive point moves forward."""
        return self.plant.signs * self.structure.shape(at)

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Names of the channels, in the order of ``out_v``."""
        return tuple(sensor.name for sensor in self.sensors)

    @cached_property
    def substeps(self) -> int:
        """Integration steps per sample: those of the converter, with ``"auto"`` the fewest that all elements allow."""
        return steps_per_sample(self.elements, self.plant, self.converter)

    @property
    def sensitivities_v_per_unit(self) -> NDArray[np.float64]:
        """Volts per newton or per m/s^2 of each channel [n_channel]."""
        return np.array([sensor.sensitivity_v_per_unit for sensor in self.sensors])

    @cached_property
    def filter_delay_samples(self) -> float:
        """Delay of every channel by the filters of the converter, in samples at low frequency; the hold not included."""
        return filter_delay(self.converter)

    @cached_property
    def channel_delays_samples(self) -> NDArray[np.float64]:
        """Delay of each channel by its own low-pass and skew [n_channel], in samples at low frequency."""
        return channel_delays(self.sensors, self.converter)

    @cached_property
    def plant(self) -> LinearPlant:
        """Linear part of the coupled plant."""
        return deviated(self._nominal_plant, self.structure.omega_rad_s, self.deviation)

    @cached_property
    def _nominal_plant(self) -> LinearPlant:
        return assemble(self.structure, self.elements, self.friction, self.exciter, self.stinger)

    @cached_property
    def linear_modes(self) -> LinearModes:
        """Modes of the structure alone with the linear stiffness of its elements, all joints stuck."""
        return structure_modes(self.plant)

    @cached_property
    def coupled_modes(self) -> LinearModes:
        """Modes of the coupled rig with voltage input, exciter and stinger; a phase resonance test does not find these."""
        return coupled_modes(self.plant)

    def drive_shape(self, near_hz: float) -> float:
        """Return the drive point's mass-normalised deflection (kg^-1/2) in the linear mode nearest to a frequency."""
        return float(self.linear_modes.drive_shape[self.linear_modes.nearest(near_hz)])
