"""What is charged and what charges it: cell, sensors, charger, disturbances."""
