"""Hosts of simulated time, in place of `rig.conformance.host.HostWatch`."""


class Punctual:
    """A host that is never late."""

    late = 0.0

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def late_s(self, began_s, ended_s):
        return self.late


class Late(Punctual):
    """A host that is always late, by up to half a second."""

    late = 0.5
