"""Exchange of stepped-sine measurements."""

from typing import Any

import numpy as np

from identification import (
    FrequencyResponse,
    pack_frequency_responses,
    unpack_frequency_responses,
)
from identification.common import MOTION_UNIT
from rig.results.kind import Exchange
from rig.text.contents import Contents


def _frequency_responses(responses: tuple[FrequencyResponse, ...]) -> Contents:
    arrays, attributes = pack_frequency_responses(responses)
    arrays["number"] = np.repeat(np.arange(1, len(responses) + 1), arrays["points_per_level"])
    kinds = sorted({MOTION_UNIT[response.kind] for response in responses})
    rows = dict.fromkeys(("number", "frequency_hz", "force", "response"), 0)
    units: dict[str, Any] = {"force": "N", "response": " or ".join(kinds), "level": "of what was controlled"}
    return Contents("frequency-responses", responses[0].specimen, arrays, attributes, rows, units)


EXCHANGE = Exchange("frequency-responses", tuple, _frequency_responses, unpack_frequency_responses)
