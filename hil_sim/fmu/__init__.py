"""Units for co-simulation by FMI: the ECU and the cell as units, and units of others as plant."""
