"""Structure, sites, stinger and exciter as one discrete-time system."""
