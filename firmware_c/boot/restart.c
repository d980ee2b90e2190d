#include "restart.h"

#define MAGIC 0x54525352u
#define MOST_COUNTED 254u

/* What is noted may change at any time and stays outside of it. */
static uint32_t check_of(const restart_record_t *record)
{
    return ~(record->magic + 3u * record->cause + 257u * record->count);
}

static bool is_known(const restart_record_t *record)
{
    return (record->magic == MAGIC) && (record->check == check_of(record));
}

void restart_begin(restart_record_t *record)
{
    if (!is_known(record)) {
        *record = (restart_record_t){ .magic = MAGIC, .cause = RESTART_POWER_ON };
    } else {
        const uint32_t noted = (record->noted == RESTART_FAULT || record->noted == RESTART_WATCHDOG)
                                   ? record->noted
                                   : (uint32_t)RESTART_OTHER;
        const uint32_t before = (noted == record->cause) ? record->count : 0u;
        record->cause = noted;
        record->count = (before < MOST_COUNTED) ? (before + 1u) : MOST_COUNTED;
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
