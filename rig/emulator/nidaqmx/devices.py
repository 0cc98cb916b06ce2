"""The devices of the emulated system: a CompactDAQ chassis with modules, and two multifunction devices that can share a clock.

Facts are NI's public specifications: NI-9234 (377849B), NI-9263, cDAQ-9189 user manual, X Series user manual for the PXIe-6356
(its table of analog input rates).
"""

from dataclasses import dataclass

SIMULTANEOUS_X_SERIES_HZ = 100e6
"""Sample clock timebase of an X Series device, Hz; rates are this over a whole number."""
DELTA_SIGMA_HZ = 13.1072e6 / 256
"""Largest rate of an NI-9234 with its internal master timebase, Hz; its rates are this over 1 to 31."""
DELTA_SIGMA_DIVISORS = 31
RANGE_MARGIN = 1.0 + 1e-9
"""Rounding that a limit at the end of a range may have."""


@dataclass(frozen=True)
class Inputs:
    """Analog inputs of a device or module."""

    count: int
    ranges_v: tuple[float, ...]
    """Full scales, V, ascending."""
    bits: int
    lowest_hz: float
    highest_hz: float
    delay_samples: float = 0.0
    """Delay of its digital filter, samples."""
    delay_s: float = 0.0
    """Further delay, s."""
    iepe_a: float = 0.0
    """IEPE current, A; 0 without."""
    high_pass_hz: float = 0.0
    """Corner of its AC coupling, Hz; 0 where there is none."""
    teds: bool = False

    @property
    def is_delta_sigma(self) -> bool:
        """Whether its converters oversample, and so coerce rates and delay inputs."""
        return self.delay_samples > 0.0


@dataclass(frozen=True)
class Outputs:
    """Analog outputs of a device or module."""

    count: int
    range_v: float
    bits: int
    highest_hz: float
    onboard_samples: int
    """Its own buffer, samples."""


@dataclass(frozen=True)
class Device:
    """A device, module or chassis."""

    name: str
    product: str
    serial: int
    chassis: str = ""
    """Name of the chassis that a module is in."""
    slot: int = 0
    inputs: Inputs | None = None
    outputs: Outputs | None = None
    watchdog: bool = False
    pfi: int = 0
    """Number of its PFI terminals."""

    @property
    def timed_by(self) -> str:
        """The device whose timing engines it uses."""
        return self.chassis or self.name

    def channels(self, kind: str) -> list[str]:
        """Names of its physical channels, ``ai`` or ``ao``."""
        group = self.inputs if kind == "ai" else self.outputs
        return [f"{self.name}/{kind}{index}" for index in range(group.count if group is not None else 0)]

    @property
    def terminals(self) -> list[str]:
        """Its terminals that a clock or trigger can be taken from."""
        if self.chassis:
            return []
        signals = [f"{kind}/{signal}" for kind in ("ai", "ao") for signal in ("SampleClock", "StartTrigger")]
        return [f"/{self.name}/{end}" for end in [*signals, *(f"PFI{index}" for index in range(self.pfi))]]


NI_9234 = Inputs(
    count=4,
    ranges_v=(5.0,),
    bits=24,
    lowest_hz=DELTA_SIGMA_HZ / DELTA_SIGMA_DIVISORS,
    highest_hz=DELTA_SIGMA_HZ,
    delay_samples=38.4,
    delay_s=3.2e-6,
    iepe_a=0.002,
    high_pass_hz=0.5,
    teds=True,
)
NI_9263 = Outputs(count=4, range_v=10.0, bits=16, highest_hz=100e3, onboard_samples=8191)
PXIE_6356_INPUTS = Inputs(count=8, ranges_v=(1.0, 2.0, 5.0, 10.0), bits=16, lowest_hz=0.0, highest_hz=1.25e6)
PXIE_6356_OUTPUTS = Outputs(count=2, range_v=10.0, bits=16, highest_hz=3.33e6, onboard_samples=8191)


def system(*, watchdog: bool = False) -> dict[str, Device]:
    """The devices by name; a cDAQ-9189 has a watchdog, a cDAQ-9178 has none."""
    devices = (
        Device("cDAQ1", "cDAQ-9189" if watchdog else "cDAQ-9178", 0x1E90001, watchdog=watchdog, pfi=2),
        Device("cDAQ1Mod1", "NI 9234", 0x1E90011, "cDAQ1", 1, inputs=NI_9234),
        Device("cDAQ1Mod2", "NI 9234", 0x1E90012, "cDAQ1", 2, inputs=NI_9234),
        Device("cDAQ1Mod3", "NI 9263", 0x1E90013, "cDAQ1", 3, outputs=NI_9263),
        Device("Dev1", "PXIe-6356", 0x1E90021, inputs=PXIE_6356_INPUTS, outputs=PXIE_6356_OUTPUTS, pfi=16),
        Device("Dev2", "PXIe-6356", 0x1E90022, inputs=PXIE_6356_INPUTS, outputs=PXIE_6356_OUTPUTS, pfi=16),
    )
    return {device.name: device for device in devices}


def coerced_hz(inputs: list[Inputs], asked_hz: float) -> float:
    """The rate that the devices of a task run at when asked for one, Hz: the next higher one, as NI-DAQmx coerces."""
    if any(group.is_delta_sigma for group in inputs):
        rates = [DELTA_SIGMA_HZ / n for n in range(DELTA_SIGMA_DIVISORS, 0, -1)]
        return next((rate for rate in rates if rate >= asked_hz * (1.0 - 1e-9)), rates[-1])
    return SIMULTANEOUS_X_SERIES_HZ / max(1, int(SIMULTANEOUS_X_SERIES_HZ / asked_hz * (1.0 + 1e-9)))
