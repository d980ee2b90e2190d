"""Monte Carlo safety: thousands of full charges of cells that differ from the nominal one."""
