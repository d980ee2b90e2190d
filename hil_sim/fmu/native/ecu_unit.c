#include "ecu_unit.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "calibration.h"
#include "content.h"
#include "port.h"

#define MS_PER_S 1000.0
#define CALIBRATION_FILE "calibration.bin"
#define LONGEST_PATH 4096

#if defined(_MSC_VER)
#define THREAD_LOCAL __declspec(thread)
#else
#define THREAD_LOCAL __thread
#endif

/* The unit whose loop runs in this thread: the four functions of a port have no argument for it. */
static THREAD_LOCAL ecu_unit_t *running;

static uint32_t to_ms(double time_s)
{
    return (uint32_t)(int64_t)floor(time_s * MS_PER_S + 0.5);
}

bool port_receive(can_frame_t *frame)
{
    if (running->arriving == NULL) {
        return false;
    }
    *frame = *running->arriving;
    running->arriving = NULL;
    return true;
}

void port_send(const can_frame_t *frame)
{
    bus_node_send(&running->node, frame, running->now_s);
}

uint32_t port_time_ms(void)
{
    return to_ms(running->now_s);
}

/* The importer moves time, not the unit. */
void port_idle(uint32_t until_ms)
{
    (void)until_ms;
}

static void turn(ecu_unit_t *unit, const can_frame_t *frame)
{
    running = unit;
    unit->arriving = frame;
    ecu_loop_turn(&unit->loop);
    running = NULL;
}

static const char *reason(image_status_t status)
{
    switch (status) {
    case IMAGE_NO_MAGIC:
        return "is no calibration";
    case IMAGE_WRONG_LENGTH:
        return "is truncated, or its length damaged";
    case IMAGE_WRONG_CRC:
        return "is damaged (CRC-32)";
    case IMAGE_WRONG_HEADER_LAYOUT:
        return "has a header of another layout";
    case IMAGE_WRONG_CALIBRATION_LAYOUT:
        return "has another layout than this unit was built for";
    case IMAGE_WRONG_FIRMWARE_VERSION:
        return "is for another firmware version";
    case IMAGE_WRONG_HASH:
        return "was edited after it had been made (SHA-256)";
    default:
        return "has a header that is not its own";
    }
}

static const bms_calibration_t *calibration_of(const ecu_unit_t *unit)
{
    const uint8_t *part = (const uint8_t *)unit->calibration;
    return (const bms_calibration_t *)(const void *)&part[sizeof(image_header_t)];
}

/* What is wrong with a part of so many bytes; NULL for nothing. */
static const char *complaint(const ecu_unit_t *unit, uint32_t length)
{
    const image_header_t application = {
        .firmware_version = BMS_FIRMWARE_VERSION,
        .calibration_layout = BMS_CALIBRATION_LAYOUT,
        .calibration_length = (uint32_t)ECU_UNIT_CALIBRATION_BYTES,
    };
    const image_header_t *header = (const image_header_t *)(const void *)unit->calibration;
    const image_memory_t place = { (const uint8_t *)unit->calibration, 0u, length };
    const image_status_t status = image_check_calibration(&place, &application);
    if (status != IMAGE_OK) {
        return reason(status);
    }
    if (header->length != length) {
        return "has bytes behind its end";
    }
    return calibration_is_valid(calibration_of(unit)) ? NULL : "has a number that the firmware does not accept";
}

bool ecu_unit_load(ecu_unit_t *unit, const char *folder, char message[ECU_UNIT_MESSAGE_BYTES])
{
    char path[LONGEST_PATH];
    const size_t folder_length = strlen(folder);
    const bool is_ended = (folder_length > 0u) && ((folder[folder_length - 1u] == '/') ||
                                                   (folder[folder_length - 1u] == '\\'));
    const char *wrong = "cannot be read";
    FILE *file = NULL;
    if (snprintf(path, sizeof path, "%s%s" CALIBRATION_FILE, folder, is_ended ? "" : "/") <
        (int)sizeof path) {
        file = fopen(path, "rb");
    }
    if (file != NULL) {
        memset(unit->calibration, 0, sizeof unit->calibration);
        const size_t length = fread(unit->calibration, 1u, ECU_UNIT_CALIBRATION_BYTES, file);
        const bool is_longer = fgetc(file) != EOF;
        (void)fclose(file);
        wrong = is_longer ? "is longer than any calibration" : complaint(unit, (uint32_t)length);
    }
    if (wrong != NULL) {
        (void)snprintf(message, ECU_UNIT_MESSAGE_BYTES,
                       "resources/" CALIBRATION_FILE " %s; make one with 'bms export --preset "
                       "PRESET --model MODEL --out DIR' and put it into the unit's resources",
                       wrong);
    }
    return wrong == NULL;
}

void ecu_unit_start(ecu_unit_t *unit, double now_s)
{
    const bms_calibration_t *calibration = calibration_of(unit);
    const bms_start_t start = { .calibration_content = content_of_calibration(calibration) };
    unit->now_s = now_s;
    unit->arriving = NULL;
    bus_node_init(&unit->node);
    ecu_loop_init(&unit->loop, calibration);
    bms_tell_start(&unit->loop.bms, &start);
}

void ecu_unit_receive(ecu_unit_t *unit, const uint8_t *operations, uint32_t length)
{
    const uint8_t *place = operations;
    bus_operation_t operation;
    can_frame_t frame;
    while (bus_next(&place, operations + length, &operation)) {
        bus_reading_t reading = BUS_NO_FRAME;
        if (!operation.is_damaged && (operation.code == BUS_CAN_TRANSMIT)) {
            reading = bus_read_frame(&operation, &frame);
            operation.is_damaged = reading == BUS_NO_FRAME;
        }
        if (reading == BUS_NO_FRAME) {
            bus_node_take(&unit->node, &operation, unit->now_s);
        } else {
            bus_node_heard(&unit->node, unit->now_s);
        }
        if (reading == BUS_FRAME) {
            turn(unit, &frame);
        }
    }
}

/* Before the first frame the loop has no phase, and nothing is due. */
static bool is_clocked(const ecu_unit_t *unit)
{
    return unit->loop.is_started;
}

void ecu_unit_follow_clock(ecu_unit_t *unit)
{
    if (is_clocked(unit)) {
        turn(unit, NULL);
    }
}

bool ecu_unit_interval(const ecu_unit_t *unit, double *interval_s)
{
    if (unit->node.outgoing.length > 0u) {
        *interval_s = 0.0;
        return true;
    }
    if (!is_clocked(unit)) {
        return false;
    }
    const int32_t left_ms = (int32_t)(unit->loop.due_ms - to_ms(unit->now_s));
    *interval_s = (left_ms > 0) ? (double)left_ms / MS_PER_S : 0.0;
    return true;
}
