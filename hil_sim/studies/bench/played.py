"""Plays a recorded charge to the firmware with nothing else in the process, to be counted.

python played.py LIBRARY CALIBRATION STATE_BYTES FRAMES FRAMES_A_PERIOD

CALIBRATION is a file with the C structure, FRAMES one with `can_frame_t` in the order of time.
"""

import ctypes
import sys
from pathlib import Path

FRAME_BYTES = 16


def main() -> None:
    """Start an ECU and give it all periods."""
    library_path, calibration_path, state_bytes, frames_path, frames_a_period = sys.argv[1:]
    library = ctypes.CDLL(library_path)
    calibration = ctypes.create_string_buffer(Path(calibration_path).read_bytes())
    content = Path(frames_path).read_bytes()
    frames = ctypes.create_string_buffer(content, len(content))
    periods = len(content) // FRAME_BYTES // int(frames_a_period)
    state = (ctypes.c_uint64 * (int(state_bytes) // 8 + 1))()
    config = ctypes.pointer(ctypes.c_void_p(ctypes.addressof(calibration)))
    commands_A = (ctypes.c_float * periods)()
    library.bms_init(state, config)
    library.host_run_periods(state, frames, int(frames_a_period), periods, commands_A)
    sys.stdout.write(f"{periods} {commands_A[periods - 1]:.6g} {sum(commands_A):.9g}\n")


main()
