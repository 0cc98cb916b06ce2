"""A JACK server of a test's own, for the emulated sound card."""

import itertools
import os
import shutil

import pytest

_numbers = itertools.count()
"""Of the servers of this process, of which two may run at once."""


def own_sound_server(monkeypatch: pytest.MonkeyPatch) -> None:
    """Give processes that this test starts a server of their own; without JACK it skips, or fails where that must be there."""
    missing = _missing()
    if missing and os.environ.get("VIBROLOCK_SOUND") == "required":
        pytest.fail(missing)
    if missing:
        pytest.skip(missing)
    monkeypatch.setenv("JACK_DEFAULT_SERVER", f"vibrolock-{os.getpid()}-{next(_numbers)}")
    monkeypatch.setenv("JACK_NO_START_SERVER", "1")
    monkeypatch.setenv("JACK_NO_AUDIO_RESERVATION", "1")


def _missing() -> str:
    if not shutil.which("jackd"):
        return "no jackd (Debian: jackd2)"
    try:
        import jack  # noqa: F401
        import sounddevice  # noqa: F401
    except (ImportError, OSError) as error:
        return f"the audio packages are not there: {error}"
    return ""
