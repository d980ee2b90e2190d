"""Prints the speed of a charge on one bus as JSON; `bms bench` runs this in the guest.

usage: python -m hil_sim.studies.bench BUS PRESET MAX_TIME_S REPETITIONS PROCESSES
"""

import json
import sys
import time
from dataclasses import asdict

from hil_sim.studies.bench.race import Clocks
from hil_sim.studies.bench.simulation import bus_speed

bus, preset, max_time_s, repetitions, processes = sys.argv[1:]
clocks = Clocks(time.perf_counter_ns, time.process_time_ns)
speed = bus_speed(bus, preset, float(max_time_s), int(repetitions), clocks, int(processes))
print(json.dumps(asdict(speed)))
