"""What surrounds the ECU: cell plant, sensors, charger, buses, nodes, recording, report."""
