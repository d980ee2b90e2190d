/* Any byte of the host in any state of a line: within its memory, and only whole frames. */
#include "proof.h"

#include "slcan.h"

int main(void)
{
    ANY(slcan_t, slcan);
    ANY(can_frame_t, frame);
    ANY(uint8_t, byte);
    GRANTED(slcan.length <= SLCAN_LONGEST_LINE + 1u);
    const bool was_open = slcan.is_open;
    const slcan_event_t event = slcan_take(&slcan, byte, &frame);
    HOLDS(slcan.length <= SLCAN_LONGEST_LINE + 1u, "a line stays within its memory");
    if (event == SLCAN_FRAME) {
        HOLDS(was_open, "a closed channel carries nothing");
        HOLDS(frame.length <= 8u, "a frame has no more than eight bytes");
        HOLDS(frame.id <= 0x7FFu, "and an identifier of eleven bits");
        HOLDS(byte == (uint8_t)SLCAN_OK, "it ends with its line");
    }
    if (byte == (uint8_t)SLCAN_OK) {
        HOLDS(slcan.length == 0u, "the next line is a new one");
    } else {
        HOLDS(event == SLCAN_NOTHING, "nothing happens within a line");
    }
    return 0;
}
