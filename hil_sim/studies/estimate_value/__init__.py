"""What knowing the core is worth: time and violations by how the firmware knows it."""
