"""Entry point of the loop process; started by `rig.loop.worker.spawn.Worker`, never by hand."""

from rig.loop.worker.process import main

main()
