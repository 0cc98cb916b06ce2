"""The DAQ contract as tests: what every driver has to pass before a rig is trusted to it.

For a driver's own tests derive from `DriverContract`; for any installed driver ``rig conformance --bench BENCH``, or
``pytest --pyargs rig.conformance --rig-bench BENCH``.
"""

from rig.conformance.answers import with_loopback
from rig.conformance.contract import DriverContract
from rig.conformance.subject import NotApplicable, Unproven
from rig.conformance.without_host import last_output_v

__all__ = ["DriverContract", "NotApplicable", "Unproven", "last_output_v", "with_loopback"]
