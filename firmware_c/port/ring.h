/* Bytes in order from one writer to one reader, of which one may be an interrupt handler. */
#ifndef RING_H
#define RING_H

#include <stdbool.h>
#include <stdint.h>

/* A power of two, so that the counters may wrap around. */
#define RING_BYTES 1024u

typedef struct {
    volatile uint32_t written; /* bytes since start-up; changed by the writer only */
    volatile uint32_t read;    /* changed by the reader only */
    volatile uint8_t bytes[RING_BYTES];
} ring_t;

/* Bytes that the writer may put without loss. */
uint32_t ring_room(const ring_t *ring);

/* False when there is no room. */
bool ring_put(ring_t *ring, uint8_t byte);

/* False when there is nothing to read. */
bool ring_get(ring_t *ring, uint8_t *byte);

#endif
