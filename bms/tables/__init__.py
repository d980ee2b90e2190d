"""Networks as the firmware's spline tables, and the rounding of its arithmetic."""

from bms.tables.network_tables import NetworkTables, network_tables

__all__ = ["NetworkTables", "network_tables"]
