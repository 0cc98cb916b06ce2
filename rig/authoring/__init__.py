"""What helps to write a bench, a plan or a virtual rig: their JSON Schemas for editors, and commented files to begin with."""
