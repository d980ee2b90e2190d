"""Networks as the firmware's polynomial tables, and bounds on what tables and float32 add."""

from bms.tables.network_tables import NetworkTables, network_tables

__all__ = ["NetworkTables", "network_tables"]
