"""Keys by which files name units, sample rates, starts, factors and times: one list for all formats."""

import re

import numpy as np

from rig.exchange.file_data import Value
from vibrolock.quantities import quantity, seconds_in

UNIT_KEYS = (
    *("units", "unit", "unitname", "unitstring", "unitstr", "unitdescription", "niunitdescription"),
    *("engineeringunits", "engineeringunit", "eu"),
)
"""Keys of units, as `plain` writes them; the first that is there counts."""
START_KEYS = ("starttime", "t0", "startoffset", "wfstartoffset", "wfstarttime", "starttimestamp")
"""Keys of the instant of the first sample, as `plain` writes them."""
_RATES = (
    *("fs", "fsample", "samplerate", "samplesrate", "samplingrate", "samplespersecond", "sampfreq"),
    *("samplefrequency", "samplefreq", "samplingfrequency", "samplingfreq", "scanrate"),
)
_STEPS = (
    *("dt", "deltat", "wfincrement", "samplinginterval", "sampleinterval", "samplingperiod", "sampleperiod"),
    *("samplingtime", "sampletime", "timestep"),
)
_FACTORS = (
    *("gain", "scale", "scaling", "scalingfactor", "conversion", "conversionfactor", "multiplier", "factor", "slope"),
    *("calibration", "calibrationfactor", "sensitivity", "polarity"),
)
_OFFSETS = ("offset", "intercept")
_TIMES = re.compile(
    r"(t|x_value|.*(time|times|zeit|temps|tiempo)([_ ]?(stamps?|axis|vector|s|sec|ms|us))?)([ _.#]?\d+)?$",
    re.IGNORECASE,
)
_PARTS = re.compile(r"[A-Za-zµμ]+")
_TIME_WORDS = {
    **{"ms": "ms", "msec": "ms", "msecs": "ms", "millis": "ms", "millisecond": "ms", "milliseconds": "ms"},
    **{"us": "us", "µs": "us", "μs": "us", "usec": "us", "micros": "us", "microseconds": "us"},
    **{"ns": "ns", "nsec": "ns", "nanos": "ns", "nanoseconds": "ns"},
    **{"s": "s", "sec": "s", "secs": "s", "second": "s", "seconds": "s", "min": "min", "mins": "min", "minutes": "min"},
    **{"h": "h", "hr": "h", "hrs": "h", "hours": "h"},
}
"""Words in the names of instants, in small letters, and the units that they are."""
_SHORT = ("s", "min", "h")  # which alone may mean something else
_GLUED = re.compile(r"(?<![A-Za-z])(?:t|time|timestamp|zeit)(ms|us|ns|msec|usec|sec)$", re.IGNORECASE)  # timems


def plain(key: str) -> str:
    """Return a key in small letters alone."""
    return re.sub(r"[\s_.-]+", "", key).lower()


def rate_named(key: str, value: Value) -> float | None:
    """Return the sample rate (Hz) that a number is by its key: ``fs``, ``Sample Rate``, ``dt``, ``fs_kHz``; else None."""
    number = number_in(value)
    if number is None or not 0.0 < number < np.inf:
        return None
    whole, parts = plain(key), re.split(r"[\s_\[\](){}-]+", key.strip("])} "))
    unit = quantity(parts[-1]) if len(parts) > 1 and whole not in (*_RATES, *_STEPS) else None
    name = whole if unit is None else plain("".join(parts[:-1]))
    factor = 1.0 if unit is None else float(unit.factor)
    if name in _RATES and (unit is None or unit.si == "Hz"):
        return number * factor
    if name in _STEPS and (unit is None or unit.si == "s"):
        return 1.0 / (number * factor)
    return None


def factor_remark(key: str, value: Value, what: str) -> str:
    """Return in words that a value, which is ``what``, seems to be a factor or an offset by its key.

    Empty for others, and for factors and offsets that change nothing.
    """
    name = plain(key)
    neutral = 1.0 if name in _FACTORS else 0.0 if name in _OFFSETS else None
    if neutral is None:
        return ""
    number = number_in(value)
    if number is not None:
        said = "" if number == neutral else f"{number:g}"
    elif isinstance(value, str):
        said = value.strip() if re.match(r"\s*[+-]?[.\d]", value) else ""
    else:
        said = ""
    return f"has {what} {key} ({said}), and the file does not say whether it is in the numbers" if said else ""


def number_in(value: Value) -> float | None:
    """Return a single number; None for anything else."""
    array = np.asarray(value) if isinstance(value, np.ndarray | np.generic | int | float) else None
    return float(array.reshape(-1)[0]) if array is not None and array.size == 1 and array.dtype.kind in "iuf" else None


def is_time_name(name: str) -> bool:
    """Return whether a name is one of instants."""
    return _TIMES.match(name) is not None


def time_unit_in(path: str) -> str:
    """Return the unit in the name of instants, ``time.ms``, ``t_us``, ``TIME (MS)``, ``timems``; empty without one.

    More counts than in names of signals: what follows ``time`` has no other meaning.
    """
    name = path.rpartition("/")[2]
    if glued := _GLUED.search(name):
        return _TIME_WORDS[glued[1].lower()]
    words = [word.lower() for word in _PARTS.findall(name)]
    found = [
        _TIME_WORDS[word]
        for at, word in enumerate(words)
        if word in _TIME_WORDS and (word not in _SHORT or (at > 0 and is_time_name(words[at - 1])))
    ]
    if found and seconds_in(found[-1]) is not None:
        return found[-1]
    return ""
