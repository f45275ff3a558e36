"""Normal equations: assembled, reduced to the exposures, factorised, iterated."""
