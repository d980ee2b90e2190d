"""One run from its settings to its result: the parts put together, a charge, its figures."""
