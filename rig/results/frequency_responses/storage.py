"""Files of stepped-sine measurements."""

from identification import pack_frequency_responses, unpack_frequency_responses
from rig.results.kind import Storage

STORAGE = Storage(pack_frequency_responses, unpack_frequency_responses)
