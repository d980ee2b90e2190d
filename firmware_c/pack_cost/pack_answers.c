/* What a pack's ECU answers to recorded frames, on whatever it is built for: hil_sim/pack/places.py
 * writes the file that it reads and holds what it writes against the ECU of the host.
 *
 * Command line: any name, the recording, and the file for the answers. The recording has a heading
 * and frames; at each SYNC the ECU steps, and its answer is written. Exit status 1 for a file that
 * cannot be read or written, or is none.
 */
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "pack_ecu.h"
#include "semihosting.h"

#define LONGEST_LINE 1024u
#define FRAMES_AT_ONCE 64u

typedef struct {
    uint32_t calibration_bytes; /* of the sender, who may have another layout */
    uint32_t cells;
    uint32_t thermistors;
    float pack_voltage_error_V;
    pack_bare_t bare;
    pack_horizon_t now;
    pack_horizon_t soon;
    pack_balance_t balance;
    uint8_t thermistor_of[BMS_MAX_CELLS];
    bms_calibration_t calibration;
} heading_t;

typedef struct {
    heading_t heading;
    pack_ecu_t ecu;
    can_frame_t frame[FRAMES_AT_ONCE];
} rig_t;

static bool answer(rig_t *rig, int32_t answers)
{
    can_frame_t frame;
    bool is_written = true;
    pack_ecu_step(&rig->ecu);
    (void)memset(&frame, 0, sizeof frame);
    while (pack_ecu_transmit(&rig->ecu, &frame)) {
        is_written = is_written && (semihosting_write(answers, &frame, sizeof frame) == 0u);
    }
    return is_written;
}

static bool play(rig_t *rig, int32_t recording, int32_t answers)
{
    heading_t *heading = &rig->heading;
    if ((semihosting_read(recording, heading, sizeof *heading) != sizeof *heading) ||
        (heading->calibration_bytes != sizeof heading->calibration)) {
        return false;
    }
    const pack_ecu_config_t config = {
        .pack = { .calibration = &heading->calibration,
                  .cells = heading->cells,
                  .thermistors = heading->thermistors,
                  .thermistor_of = heading->thermistor_of,
                  .bare = heading->bare },
        .pack_voltage_error_V = heading->pack_voltage_error_V,
        .now = heading->now,
        .soon = heading->soon,
        .balance = heading->balance,
    };
    pack_ecu_init(&rig->ecu, &config);
    bool is_well = true;
    uint32_t bytes = semihosting_read(recording, rig->frame, sizeof rig->frame);
    while (is_well && (bytes > 0u)) {
        for (uint32_t i = 0u; i < bytes / sizeof rig->frame[0]; i++) {
            if (rig->frame[i].id == PACK_SYNC_ID) {
                is_well = answer(rig, answers) && is_well;
            } else {
                pack_ecu_receive(&rig->ecu, &rig->frame[i]);
            }
        }
        is_well = is_well && ((bytes % sizeof rig->frame[0]) == 0u);
        bytes = semihosting_read(recording, rig->frame, sizeof rig->frame);
    }
    return is_well;
}

/* The word after this one, which is ended. */
static char *next_word(char *word)
{
    char *end = word;
    while ((*end != '\0') && (*end != ' ')) {
        end++;
    }
    if (*end == ' ') {
        *end = '\0';
        end++;
    }
    return end;
}

int main(void)
{
    static rig_t rig;
    static char line[LONGEST_LINE];
    semihosting_command_line(line, sizeof line);
    char *first = next_word(line);
    const char *second = next_word(first);
    const int32_t recording = semihosting_open(first, SEMIHOSTING_READ);
    const int32_t answers = semihosting_open(second, SEMIHOSTING_WRITE);
    const bool is_done = (recording >= 0) && (answers >= 0) && play(&rig, recording, answers);
    semihosting_exit(is_done ? 0u : 1u);
    return 0;
}
