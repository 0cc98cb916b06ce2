# Flash, RAM, stack and instructions of the core on a Cortex-M4.

.PHONY: arm-measures
arm-measures: ## flash, RAM, stack and instructions on a Cortex-M4: tables, in some two minutes
	python3 checks/arm/measures.py
