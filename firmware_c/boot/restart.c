#include "restart.h"

#define CHECK_START 0x54525352u /* so that cleared memory is no record */
#define MOST_COUNTED 253u

static uint32_t check_of(const restart_record_t *record)
{
    return ~(CHECK_START + 3u * record->cause + 257u * record->count);
}

void restart_begin(restart_record_t *record)
{
    if (record->check != check_of(record)) {
        *record = (restart_record_t){ .cause = RESTART_POWER_ON };
    } else {
        record->cause = (record->noted == RESTART_FAULT || record->noted == RESTART_WATCHDOG)
                            ? record->noted
                            : (uint32_t)RESTART_OTHER;
        record->count = (record->count < MOST_COUNTED) ? (record->count + 1u) : MOST_COUNTED;
    }
    record->noted = RESTART_OTHER;
    record->check = check_of(record);
}

bool restart_is_hopeless(const restart_record_t *record)
{
    return record->count >= RESTART_MOST;
}

void restart_forgive(restart_record_t *record)
{
    record->count = 0u;
    record->check = check_of(record);
}
