"""Kill -9 in every phase of a run: no row whose write had returned is lost or changed, and nothing is left behind."""
