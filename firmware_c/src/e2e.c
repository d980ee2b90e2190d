#include "e2e.h"

#define CRC8_POLYNOMIAL 0x2Fu
#define CRC8_START 0xFFu
#define CRC8_FINAL_XOR 0xFFu
#define COUNTER_MASK 0x0Fu

static uint8_t crc8_byte(uint8_t crc, uint8_t byte)
{
    uint32_t shifted = (uint32_t)crc ^ byte;
    for (uint32_t bit = 0u; bit < 8u; bit++) {
        shifted = (shifted & 0x80u) ? ((shifted << 1u) ^ CRC8_POLYNOMIAL) : (shifted << 1u);
    }
    return (uint8_t)(shifted & 0xFFu);
}

uint8_t e2e_crc(const uint8_t *data, uint8_t length, const uint8_t data_ids[E2E_COUNTERS])
{
    uint8_t crc = CRC8_START;
    for (uint8_t i = 1u; i < length; i++) {
        crc = crc8_byte(crc, data[i]);
    }
    crc = crc8_byte(crc, data_ids[data[1] & COUNTER_MASK]);
    return (uint8_t)(crc ^ CRC8_FINAL_XOR);
}

void e2e_protect(uint8_t *data, uint8_t length, const uint8_t data_ids[E2E_COUNTERS],
                 uint8_t counter)
{
    data[1] = (uint8_t)((data[1] & (uint8_t)~COUNTER_MASK) | (counter & COUNTER_MASK));
    data[0] = e2e_crc(data, length, data_ids);
}

e2e_status_t e2e_check(e2e_receiver_t *receiver, const uint8_t *data, uint8_t length,
                       uint8_t expected_length, const uint8_t data_ids[E2E_COUNTERS],
                       uint8_t max_jump)
{
    if ((length != expected_length) || (length < E2E_HEADER_LENGTH)) {
        return E2E_WRONG_LENGTH;
    }
    if (data[0] != e2e_crc(data, length, data_ids)) {
        return E2E_WRONG_CRC;
    }
    const uint8_t counter = data[1] & COUNTER_MASK;
    const uint8_t jump = (uint8_t)((counter - receiver->counter) & COUNTER_MASK);
    const uint8_t started = receiver->started;
    if (started && (jump == 0u)) {
        return E2E_REPEATED;
    }
    receiver->counter = counter;
    receiver->started = 1u;
    return (started && (jump > max_jump)) ? E2E_WRONG_SEQUENCE : E2E_OK;
}
