"""Gains and growth limit of a preset, chosen for the time to full under the certificate."""
