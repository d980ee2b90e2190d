#include "ring.h"

uint32_t ring_room(const ring_t *ring)
{
    const uint32_t written = ring->written;
    return RING_BYTES - (written - ring->read);
}

bool ring_put(ring_t *ring, uint8_t byte)
{
    const uint32_t written = ring->written;
    if (ring_room(ring) == 0u) {
        return false;
    }
    ring->bytes[written % RING_BYTES] = byte;
    ring->written = written + 1u; /* last, so that the reader never sees an unwritten byte */
    return true;
}

bool ring_get(ring_t *ring, uint8_t *byte)
{
    const uint32_t read = ring->read;
    if (read == ring->written) {
        return false;
    }
    *byte = ring->bytes[read % RING_BYTES];
    ring->read = read + 1u;
    return true;
}
