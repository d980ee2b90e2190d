"""Currents at which no lithium plates on the anode of an electrochemical model."""
