"""The DAQ contract as tests: what every driver has to pass before a rig is trusted to it.

For a driver's own tests derive from `DriverContract`; for any installed driver ``rig conformance --bench BENCH``, or
``pytest --pyargs rig.conformance --rig-bench BENCH``.
"""

from rig.conformance.contract import DriverContract, NotApplicable

__all__ = ["DriverContract", "NotApplicable"]
