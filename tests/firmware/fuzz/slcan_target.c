/* A host's bytes through the serial line of a board, and the board's frames back; beside it a reader
 * of slcan lines of its own.
 */
#include "input.h"
#include "slcan_link.h"

#define MOST_LINE 64u

static struct {
    slcan_link_t link;
    uint32_t waiting; /* bytes that the link has not been asked for */
    bool is_lossless; /* there was room for every byte */
    bool ends_in_loss; /* the present line lost a byte */
    uint32_t lossy_lines;
    uint8_t line[MOST_LINE];
    uint32_t length; /* beyond MOST_LINE: more than any line */
    bool is_open;
    can_frame_t expected[RING_BYTES];
    uint32_t expected_frames;
} run;

static int32_t digit(uint8_t character)
{
    const char *const digits = "0123456789ABCDEFabcdef";
    const char *found = (character != 0u) ? strchr(digits, character) : NULL;
    const int32_t place = (found != NULL) ? (int32_t)(found - digits) : -1;
    return (place > 15) ? place - 6 : place;
}

/* t, three digits up to 7FF, a length up to 8, two digits a byte, no more. */
static bool is_frame(can_frame_t *frame)
{
    uint32_t numbers[MOST_LINE] = { 0u };
    if ((run.length < 5u) || (run.length > 21u) || (run.line[0] != (uint8_t)'t')) {
        return false;
    }
    for (uint32_t i = 1u; i < run.length; i++) {
        const int32_t value = digit(run.line[i]);
        if (value < 0) {
            return false;
        }
        numbers[i] = (uint32_t)value;
    }
    *frame = (can_frame_t){ .id = 256u * numbers[1] + 16u * numbers[2] + numbers[3],
                            .length = (uint8_t)numbers[4] };
    for (uint32_t i = 0u; (2u * i + 6u < run.length) && (i < 8u); i++) {
        frame->data[i] = (uint8_t)(16u * numbers[5u + 2u * i] + numbers[6u + 2u * i]);
    }
    return (frame->id < 2048u) && (frame->length <= 8u) && (run.length == 5u + 2u * frame->length);
}

static void end_line(void)
{
    can_frame_t frame;
    const uint8_t first = run.line[0];
    if ((run.length > 0u) && (run.length <= SLCAN_LONGEST_LINE)) {
        if ((first == (uint8_t)'O') || (first == (uint8_t)'L')) {
            run.is_open = true;
        } else if (first == (uint8_t)'C') {
            run.is_open = false;
        } else if (run.is_open && is_frame(&frame)) {
            run.expected[run.expected_frames] = frame;
            run.expected_frames++;
        }
    }
    run.length = 0u;
}

static void put(uint8_t byte)
{
    const bool has_room = ring_room(&run.link.from_host) > 0u;
    run.is_lossless = run.is_lossless && has_room;
    /* An end that found no room comes late, and its line is whole. */
    run.ends_in_loss = run.ends_in_loss || (!has_room && (byte != (uint8_t)'\r'));
    slcan_link_put(&run.link, byte);
    if (byte == (uint8_t)'\r') {
        run.lossy_lines += run.ends_in_loss ? 1u : 0u;
        run.ends_in_loss = false;
        end_line();
    } else if (run.length < MOST_LINE) {
        run.line[run.length] = byte;
        run.length++;
    }
}

static bool is_same(const can_frame_t *a, const can_frame_t *b)
{
    return (a->id == b->id) && (a->length == b->length) && (memcmp(a->data, b->data, a->length) == 0);
}

static void receive(void)
{
    can_frame_t frame = { 0 };
    uint32_t next = 0u;
    while (slcan_link_receive(&run.link, &frame)) {
        MUST(frame.id <= 0x7FFu, "an identifier above eleven bits");
        MUST(frame.length <= 8u, "more than eight bytes");
        MUST(!run.is_lossless || ((next < run.expected_frames) && is_same(&frame, &run.expected[next])),
             "a frame that the host did not send");
        next++;
    }
    MUST(!run.is_lossless || (next == run.expected_frames), "a frame of the host is missing");
    MUST(!run.is_lossless || (run.link.slcan.is_open == run.is_open), "open or closed by nobody");
    MUST(run.link.lines_lost >= run.lossy_lines, "a line lost in silence");
    run.expected_frames = 0u;
    MUST(slcan_link_is_quiet(&run.link), "bytes are left over");
}

/* What the host gets is whole lines. */
static void get(void)
{
    uint8_t byte;
    uint32_t length = 0u;
    while (slcan_link_get(&run.link, &byte)) {
        const bool is_end = (byte == (uint8_t)'\r') || (byte == (uint8_t)'\a');
        MUST(is_end || ((byte >= (uint8_t)'0') && (byte <= (uint8_t)'z')), "no text for the host");
        length = is_end ? 0u : length + 1u;
        MUST(length < SLCAN_LONGEST_FRAME, "a line for the host that has no end");
    }
    MUST(length == 0u, "half a line for the host");
}

static void send(input_t *input)
{
    can_frame_t frame = { .id = input_16(input) & 0x7FFu, .length = input_byte(input) % 9u };
    for (uint32_t i = 0u; i < frame.length; i++) {
        frame.data[i] = input_byte(input);
    }
    const uint32_t lost = run.link.frames_lost;
    const uint32_t room = ring_room(&run.link.to_host);
    slcan_link_send(&run.link, &frame);
    MUST(!run.link.slcan.is_open || (room >= SLCAN_LONGEST_FRAME) || (run.link.frames_lost > lost) ||
             (ring_room(&run.link.to_host) < room), "a frame lost in silence");
    uint8_t text[SLCAN_LONGEST_FRAME];
    can_frame_t back = { 0 };
    slcan_t reader = { .is_open = true };
    slcan_event_t event = SLCAN_NOTHING;
    const uint32_t length = slcan_print(&frame, text);
    for (uint32_t i = 0u; i < length; i++) {
        event = slcan_take(&reader, text[i], &back);
    }
    MUST((event == SLCAN_FRAME) && is_same(&frame, &back), "text that does not read back");
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length)
{
    input_t input = { bytes, length };
    memset(&run, 0, sizeof run);
    run.is_lossless = true;
    /* Counters that wrap around within the input. */
    const uint32_t start = 0u - (uint32_t)input_byte(&input);
    run.link.from_host.written = run.link.from_host.read = start;
    run.link.to_host.written = run.link.to_host.read = start;
    while (input.left > 0u) {
        const uint8_t byte = input_byte(&input);
        if (byte == 0xF0u) {
            receive();
        } else if (byte == 0xF1u) {
            get();
        } else if (byte == 0xF2u) {
            send(&input);
        } else if (byte == 0xF3u) { /* a line again and again, as long as there is more than room */
            const uint8_t again = input_byte(&input);
            for (uint32_t left = 5u * (uint32_t)input_byte(&input); left > 0u; left--) {
                put(again);
            }
        } else {
            put(byte);
        }
        MUST(ring_room(&run.link.from_host) <= RING_BYTES, "more bytes taken than were put");
        MUST(ring_room(&run.link.to_host) <= RING_BYTES, "more bytes taken than were put");
        if (run.expected_frames > RING_BYTES - 2u) {
            receive();
        }
    }
    receive();
    get();
    return 0;
}
