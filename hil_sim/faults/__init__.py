"""Faults of a run as data: what goes wrong, where and when, and what the ECU has to do then."""

from hil_sim.faults.base import Fault
from hil_sim.faults.injection import InjectedFault, Injection
from hil_sim.faults.plan import load_faults, parse_fault

__all__ = ["Fault", "InjectedFault", "Injection", "load_faults", "parse_fault"]
