"""Dynamic models: modal, polynomial state-space (PNLSS) and structured ones."""
