"""Hosts of simulated time, in place of `rig.conformance.host.HostWatch`."""


class Punctual:
    """A host that is never late."""

    late = False

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def was_late(self, began_s, ended_s):
        return self.late


class Late(Punctual):
    """A host that is always late."""

    late = True
