"""A run as it can be watched from outside: published in memory that any number of readers take and none can hold up.

The campaign's process writes (`rig.live.publisher`) and waits for nobody; whoever watches reads (`rig.live.reader`). All that a
reader can do to a run is to leave a request to stop (`rig.live.stopping`).
"""
