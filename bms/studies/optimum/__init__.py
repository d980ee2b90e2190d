"""Lower bound on the time to full that no controller can beat, and profiles that come close."""
