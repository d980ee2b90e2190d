/* Why the processor starts: a record in memory that outlasts a reset, but not the power.
 *
 * Whoever resets on purpose notes the cause first; the boot stage counts the starts since the power
 * came, whatever their causes, and after a few starts nothing until the power comes anew. The
 * application ends the row by running for long enough.
 */
#ifndef RESTART_H
#define RESTART_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Starts in a row, without the power, with which the boot stage starts the application no more. */
#define RESTART_MOST 3u

/* An application that has run for so long is one that runs. */
#define RESTART_RUNS_AFTER_MS 60000u

/* Values of ResetCause in the database. */
typedef enum {
    RESTART_POWER_ON = 0,
    RESTART_FAULT = 1,
    RESTART_WATCHDOG = 2,
    RESTART_OTHER = 3 /* nobody noted one: the reset line, or the watchdog's second step */
} restart_cause_t;

typedef struct {
    uint32_t noted; /* restart_cause_t of the next start */
    uint32_t cause; /* of this start */
    uint32_t count; /* starts in a row, this one included; 0 after power came */
    uint32_t check; /* over cause and count: what power left behind is no record */
} restart_record_t;

/* To be called once at each start: finds the cause in the record, and counts. */
void restart_begin(restart_record_t *record);

/* Whether it is time to give up. */
bool restart_is_hopeless(const restart_record_t *record);

/* Ends the row: the next start counts as the first. */
void restart_forgive(restart_record_t *record);

#ifdef __cplusplus
}
#endif

#endif
