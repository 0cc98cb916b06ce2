"""Entry point of the loop process; started by `rig.worker.spawn.Worker`, never by hand."""

from rig.worker.process import main

main()
