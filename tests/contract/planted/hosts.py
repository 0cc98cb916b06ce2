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

    def stalls_alone(self, limit_s, for_s):
        return self.late > limit_s


class Late(Punctual):
    """A host that is always late, by up to half a second."""

    late = 0.5


class LateUnseen(Punctual):
    """A host that is late without its naps showing it."""

    def stalls_alone(self, limit_s, for_s):
        return True
