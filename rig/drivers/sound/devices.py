"""The sound devices of this computer, through PortAudio (package ``sounddevice``)."""

import time
from typing import Any, NamedTuple

from rig.drivers.sound.rates import RATES_HZ
from rig.errors import DaqBusy, DaqDisconnected, DaqError, DaqRefused, DaqTimeout

MISSING = "the package sounddevice is not installed (pip install 'vibrolock[sound]')"
"""What to do where the package is missing."""
INITIALISATIONS = 3
"""Attempts to initialise PortAudio; chosen: on a busy computer a JACK server may have no time for it."""
LOOKS, BETWEEN_LOOKS_S = 4, 0.5
"""Attempts to find a device, and the time between two of them, s; chosen: a JACK server that has not answered in time is no
error of PortAudio's, its devices are missing."""


class SoundDevice(NamedTuple):
    """A sound device as PortAudio lists it."""

    number: int
    """Its index among all devices."""
    name: str
    host_api: str
    inputs: int
    """Number of its inputs."""
    outputs: int
    """Number of its outputs."""
    rate_hz: float
    """Rate at which it runs by default, Hz."""
    delay_s: float
    """Delay from output to input that it promises, s; many devices promise too little."""

    @property
    def text(self) -> str:
        """Name and host interface."""
        return f"{self.name!r} ({self.host_api})"


def library() -> Any:
    """Return the package ``sounddevice``, which loads PortAudio.

    Raises `DaqRefused` where it, or PortAudio itself, is not installed.
    """
    try:
        import sounddevice
    except ImportError:
        raise DaqRefused(MISSING) from None
    except OSError:
        raise DaqRefused(
            "PortAudio is not installed; on Debian: apt install libportaudio2, elsewhere it comes with sounddevice"
        ) from None
    return sounddevice


def release() -> None:
    """Let PortAudio go, which it must while the audio server of its last stream still runs: JACK's library aborts otherwise."""
    audio = library()
    while audio._initialized:
        audio._terminate()


_ABANDONED: list[object] = []
"""What streams that could not be closed may still write to."""


def abandon(memory: object) -> None:
    """Leave PortAudio and the memory of its stream as they are, also at the end of this process: the audio server is gone."""
    _ABANDONED.append(memory)
    library()._initialized = 0


def sound_devices() -> list[SoundDevice]:
    """Return the devices there are now; PortAudio looks for them when it is initialised, so it is initialised anew.

    Raises `DaqTimeout` where an audio server does not answer.
    """
    release()
    audio = library()
    for attempt in reversed(range(INITIALISATIONS)):
        try:
            audio._initialize()
            break
        except audio.PortAudioError as error:
            if not attempt:
                raise DaqTimeout(
                    f"PortAudio cannot begin, for its audio system or server does not answer: {error}"
                ) from error
    names = [host["name"] for host in audio.query_hostapis()]
    return [
        SoundDevice(
            device["index"],
            device["name"],
            names[device["hostapi"]],
            device["max_input_channels"],
            device["max_output_channels"],
            device["default_samplerate"],
            device["default_low_input_latency"] + device["default_low_output_latency"],
        )
        for device in audio.query_devices()
    ]


def found(name: str | int, host_api: str) -> SoundDevice:
    """Return the device of a name, or of a part of it, or of an index; one that is not there is looked for again for 1.5 s.

    Raises `DaqDisconnected` where there is none, `DaqRefused` where there are several.
    """
    for look in range(LOOKS):
        if look:
            time.sleep(BETWEEN_LOOKS_S)
        devices = sound_devices()
        matching = _called(name, [one for one in devices if host_api.casefold() in one.host_api.casefold()])
        if matching:
            break
    if len(matching) == 1:
        return matching[0]
    field = "driver.options.device"
    if not matching:
        raise DaqDisconnected(
            "there is no such sound device",
            field=field,
            value=name,
            allowed=_listed(devices),
            hint="is it switched on?",
        )
    raise DaqRefused(
        f"{len(matching)} sound devices are called so",
        field=field,
        value=name,
        allowed=_listed(matching),
        hint="add driver.options.host_api, or give the whole name",
    )


def _called(name: str | int, devices: list[SoundDevice]) -> list[SoundDevice]:
    if isinstance(name, int):
        return [one for one in devices if one.number == name]
    exactly = [one for one in devices if one.name == name]
    return exactly or [one for one in devices if name.casefold() in one.name.casefold()]


def _listed(devices: list[SoundDevice]) -> str:
    return ", ".join(one.text for one in devices) or "none, for this computer has no sound device"


def supported_rates(device: SoundDevice, inputs: int, outputs: int) -> list[float]:
    """Return the sample rates, Hz, at which the device has so many inputs and outputs."""
    audio = library()
    rates = []
    for rate in sorted({*RATES_HZ, device.rate_hz}):
        try:
            audio.check_input_settings(device.number, inputs, "float32", samplerate=rate)
            audio.check_output_settings(device.number, outputs, "float32", samplerate=rate)
        except (audio.PortAudioError, ValueError):
            continue
        rates.append(rate)
    return rates


def as_sound_error(error: Exception, device: str) -> DaqError:
    """Return an error of PortAudio as one of ours, by its number."""
    arguments: tuple[Any, ...] = error.args
    code = arguments[1] if len(arguments) > 1 and isinstance(arguments[1], int) else 0
    text = str(arguments[0] if arguments else error)
    if code == -9985:  # paDeviceUnavailable
        return DaqBusy(f"{device}: another program uses the device; close it ({text})")
    if code in (-9996, -9988):  # paInvalidDevice, paBadStreamPtr
        return DaqDisconnected(f"{device}: the device is gone ({text})")
    return DaqError(f"{device}: {text}")
