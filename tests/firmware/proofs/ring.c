/* Any byte into and out of a ring in any state that it can have: none lost, none invented. */
#include "proof.h"

#include "ring.h"

int main(void)
{
    static ring_t ring;
    ANY(uint32_t, read);
    ANY(uint32_t, held);
    ANY(uint8_t, byte);
    ANY(uint8_t, taken);
    GRANTED(held <= RING_BYTES);
    ring.read = read;
    ring.written = read + held;
    const bool is_put = ring_put(&ring, byte);
    HOLDS(is_put == (held < RING_BYTES), "a byte is taken where there is room");
    HOLDS(ring.written - ring.read == held + (is_put ? 1u : 0u), "it is counted");
    HOLDS(ring_room(&ring) <= RING_BYTES, "room is what the ring has");
    const bool is_got = ring_get(&ring, &taken);
    HOLDS(is_got == (held + (is_put ? 1u : 0u) > 0u), "a byte comes where there is one");
    HOLDS((held != 0u) || (taken == byte), "the one that was put, over the counters' end too");
    return 0;
}
