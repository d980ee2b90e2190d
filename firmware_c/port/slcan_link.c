#include "slcan_link.h"

static const uint8_t VERSION[] = { 'V', '1', '0', '1', '0', SLCAN_OK };
static const uint8_t SERIAL_NUMBER[] = { 'N', '0', '0', '0', '0', SLCAN_OK };

/* All of the text or nothing. */
static bool queue(slcan_link_t *link, const uint8_t *text, uint32_t length)
{
    if (ring_room(&link->to_host) < length) {
        return false;
    }
    for (uint32_t i = 0u; i < length; i++) {
        (void)ring_put(&link->to_host, text[i]);
    }
    return true;
}

static bool queue_frame(slcan_link_t *link, const can_frame_t *frame)
{
    uint8_t text[SLCAN_LONGEST_FRAME];
    return queue(link, text, slcan_print(frame, text));
}

static void write_number(uint32_t number, uint8_t bytes[4])
{
    for (uint32_t i = 0u; i < 4u; i++) {
        bytes[i] = (uint8_t)(number >> (8u * i));
    }
}

static void report_losses(slcan_link_t *link)
{
    const uint32_t lines = link->lines_lost;
    const uint32_t frames = link->frames_lost;
    if ((lines != link->lines_lost_reported) || (frames != link->frames_lost_reported)) {
        can_frame_t report = { .id = SLCAN_LINK_LOSS_ID, .length = 8u };
        write_number(lines, &report.data[0]);
        write_number(frames, &report.data[4]);
        if (queue_frame(link, &report)) {
            link->lines_lost_reported = lines;
            link->frames_lost_reported = frames;
        }
    }
}

/* What was lost since the host asked last. */
static uint8_t take_flags(slcan_link_t *link)
{
    const uint32_t lines = link->lines_lost;
    const uint32_t frames = link->frames_lost;
    const uint32_t flags = ((lines != link->lines_lost_flagged) ? SLCAN_LINK_RECEIVE_FULL : 0u) |
                           ((frames != link->frames_lost_flagged) ? SLCAN_LINK_SEND_FULL : 0u);
    link->lines_lost_flagged = lines;
    link->frames_lost_flagged = frames;
    return (uint8_t)flags;
}

static void answer(slcan_link_t *link, slcan_event_t event)
{
    const uint8_t ok = (uint8_t)SLCAN_OK;
    const uint8_t error = (uint8_t)SLCAN_ERROR;
    uint8_t flags[4] = { 'F', 0u, 0u, ok };
    switch (event) {
    case SLCAN_ACCEPTED:
        (void)queue(link, &ok, 1u);
        break;
    case SLCAN_REFUSED:
        (void)queue(link, &error, 1u);
        break;
    case SLCAN_ASKED_FLAGS:
        slcan_print_byte(take_flags(link), &flags[1]);
        (void)queue(link, flags, sizeof flags);
        break;
    case SLCAN_ASKED_VERSION:
        (void)queue(link, VERSION, sizeof VERSION);
        break;
    case SLCAN_ASKED_SERIAL_NUMBER:
        (void)queue(link, SERIAL_NUMBER, sizeof SERIAL_NUMBER);
        break;
    default:
        break;
    }
}

/* The beginning of a line that is cut off gets its end late, before the next line: by itself it is
 * no valid line, unless it lacks nothing else. */
void slcan_link_put(slcan_link_t *link, uint8_t byte)
{
    const uint8_t end = (uint8_t)SLCAN_OK;
    if (link->is_cut_off && !link->is_dropping && ring_put(&link->from_host, end)) {
        link->is_cut_off = false;
    }
    if (!link->is_cut_off && ring_put(&link->from_host, byte)) {
        return;
    }
    if (link->is_dropping && (byte == end)) {
        link->lines_lost++;
    }
    link->is_cut_off = true;
    link->is_dropping = (byte != end);
}

bool slcan_link_get(slcan_link_t *link, uint8_t *byte)
{
    return ring_get(&link->to_host, byte);
}

bool slcan_link_is_quiet(const slcan_link_t *link)
{
    return ring_room(&link->from_host) == RING_BYTES;
}

bool slcan_link_receive(slcan_link_t *link, can_frame_t *frame)
{
    uint8_t byte;
    while (ring_get(&link->from_host, &byte)) {
        const slcan_event_t event = slcan_take(&link->slcan, byte, frame);
        if (event == SLCAN_FRAME) {
            return true;
        }
        answer(link, event);
    }
    if (link->slcan.is_open) {
        report_losses(link); /* an application that sends nothing would never tell */
    }
    return false;
}

void slcan_link_send(slcan_link_t *link, const can_frame_t *frame)
{
    if (!link->slcan.is_open) {
        return;
    }
    if (!queue_frame(link, frame)) {
        link->frames_lost++;
    }
    report_losses(link);
}
