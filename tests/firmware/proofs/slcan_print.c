/* Any frame as text: no longer than its buffer, and read back as it was. */
#include "proof.h"

#include "slcan.h"

int main(void)
{
    ANY(can_frame_t, frame);
    uint8_t text[SLCAN_LONGEST_FRAME];
    static slcan_t slcan;
    can_frame_t back;
    ANY(uint32_t, at);
    GRANTED((frame.length <= 8u) && (frame.id <= 0x7FFu) && (at < 8u));
    const uint32_t length = slcan_print(&frame, text);
    HOLDS(length == 6u + 2u * frame.length, "head, two digits a byte, end of line");
    slcan.is_open = true;
    slcan_event_t event = SLCAN_NOTHING;
    for (uint32_t i = 0u; i < SLCAN_LONGEST_FRAME; i++) {
        if (i < length) {
            HOLDS(event == SLCAN_NOTHING, "nothing before the end");
            event = slcan_take(&slcan, text[i], &back);
        }
    }
    HOLDS(event == SLCAN_FRAME, "the text is a frame");
    HOLDS((back.id == frame.id) && (back.length == frame.length), "the same one");
    HOLDS((at >= frame.length) || (back.data[at] == frame.data[at]), "with each byte");
    return 0;
}
