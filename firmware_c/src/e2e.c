#include "e2e.h"

#include "numeric.h"

#define CRC8_START 0xFFu
#define CRC8_FINAL_XOR 0xFFu
#define COUNTER_MASK 0x0Fu

/* Remainders of all bytes for polynomial 0x2F. */
static const uint8_t CRC8_OF_BYTE[256] = {
    0x00u, 0x2Fu, 0x5Eu, 0x71u, 0xBCu, 0x93u, 0xE2u, 0xCDu, 0x57u, 0x78u, 0x09u, 0x26u,
    0xEBu, 0xC4u, 0xB5u, 0x9Au, 0xAEu, 0x81u, 0xF0u, 0xDFu, 0x12u, 0x3Du, 0x4Cu, 0x63u,
    0xF9u, 0xD6u, 0xA7u, 0x88u, 0x45u, 0x6Au, 0x1Bu, 0x34u, 0x73u, 0x5Cu, 0x2Du, 0x02u,
    0xCFu, 0xE0u, 0x91u, 0xBEu, 0x24u, 0x0Bu, 0x7Au, 0x55u, 0x98u, 0xB7u, 0xC6u, 0xE9u,
    0xDDu, 0xF2u, 0x83u, 0xACu, 0x61u, 0x4Eu, 0x3Fu, 0x10u, 0x8Au, 0xA5u, 0xD4u, 0xFBu,
    0x36u, 0x19u, 0x68u, 0x47u, 0xE6u, 0xC9u, 0xB8u, 0x97u, 0x5Au, 0x75u, 0x04u, 0x2Bu,
    0xB1u, 0x9Eu, 0xEFu, 0xC0u, 0x0Du, 0x22u, 0x53u, 0x7Cu, 0x48u, 0x67u, 0x16u, 0x39u,
    0xF4u, 0xDBu, 0xAAu, 0x85u, 0x1Fu, 0x30u, 0x41u, 0x6Eu, 0xA3u, 0x8Cu, 0xFDu, 0xD2u,
    0x95u, 0xBAu, 0xCBu, 0xE4u, 0x29u, 0x06u, 0x77u, 0x58u, 0xC2u, 0xEDu, 0x9Cu, 0xB3u,
    0x7Eu, 0x51u, 0x20u, 0x0Fu, 0x3Bu, 0x14u, 0x65u, 0x4Au, 0x87u, 0xA8u, 0xD9u, 0xF6u,
    0x6Cu, 0x43u, 0x32u, 0x1Du, 0xD0u, 0xFFu, 0x8Eu, 0xA1u, 0xE3u, 0xCCu, 0xBDu, 0x92u,
    0x5Fu, 0x70u, 0x01u, 0x2Eu, 0xB4u, 0x9Bu, 0xEAu, 0xC5u, 0x08u, 0x27u, 0x56u, 0x79u,
    0x4Du, 0x62u, 0x13u, 0x3Cu, 0xF1u, 0xDEu, 0xAFu, 0x80u, 0x1Au, 0x35u, 0x44u, 0x6Bu,
    0xA6u, 0x89u, 0xF8u, 0xD7u, 0x90u, 0xBFu, 0xCEu, 0xE1u, 0x2Cu, 0x03u, 0x72u, 0x5Du,
    0xC7u, 0xE8u, 0x99u, 0xB6u, 0x7Bu, 0x54u, 0x25u, 0x0Au, 0x3Eu, 0x11u, 0x60u, 0x4Fu,
    0x82u, 0xADu, 0xDCu, 0xF3u, 0x69u, 0x46u, 0x37u, 0x18u, 0xD5u, 0xFAu, 0x8Bu, 0xA4u,
    0x05u, 0x2Au, 0x5Bu, 0x74u, 0xB9u, 0x96u, 0xE7u, 0xC8u, 0x52u, 0x7Du, 0x0Cu, 0x23u,
    0xEEu, 0xC1u, 0xB0u, 0x9Fu, 0xABu, 0x84u, 0xF5u, 0xDAu, 0x17u, 0x38u, 0x49u, 0x66u,
    0xFCu, 0xD3u, 0xA2u, 0x8Du, 0x40u, 0x6Fu, 0x1Eu, 0x31u, 0x76u, 0x59u, 0x28u, 0x07u,
    0xCAu, 0xE5u, 0x94u, 0xBBu, 0x21u, 0x0Eu, 0x7Fu, 0x50u, 0x9Du, 0xB2u, 0xC3u, 0xECu,
    0xD8u, 0xF7u, 0x86u, 0xA9u, 0x64u, 0x4Bu, 0x3Au, 0x15u, 0x8Fu, 0xA0u, 0xD1u, 0xFEu,
    0x33u, 0x1Cu, 0x6Du, 0x42u,
};

uint8_t e2e_crc(const uint8_t *data, uint8_t length, const uint8_t data_ids[E2E_COUNTERS])
{
    uint32_t crc = CRC8_START;
    const uint8_t *byte = &data[1];
    const uint8_t *const end = &data[length];
    do {
        crc = CRC8_OF_BYTE[crc ^ *byte];
        byte++;
    } while (byte < end);
    crc = CRC8_OF_BYTE[crc ^ data_ids[data[1] & COUNTER_MASK]];
    return (uint8_t)(crc ^ CRC8_FINAL_XOR);
}

void e2e_protect(uint8_t *data, uint8_t length, const uint8_t data_ids[E2E_COUNTERS],
                 uint8_t counter)
{
    data[1] = (uint8_t)((data[1] & (uint8_t)~COUNTER_MASK) | (counter & COUNTER_MASK));
    data[0] = e2e_crc(data, length, data_ids);
}

static void count(uint8_t *number, uint8_t frames)
{
    const uint8_t room = (uint8_t)(UINT8_MAX - *number);
    *number = (uint8_t)(*number + ((frames < room) ? frames : room));
}

static uint8_t steps_between(uint8_t older, uint8_t newer)
{
    return (uint8_t)((newer - older) & COUNTER_MASK);
}

static e2e_status_t check_counter(e2e_receiver_t *receiver, uint8_t counter,
                                  uint8_t max_delta_counter)
{
    const uint8_t steps = steps_between(receiver->counter, counter);
    if (!receiver->has_started) {
        receiver->has_started = true;
    } else if ((steps == 0u) ||
               (receiver->has_refused && (counter == receiver->refused_counter))) {
        count(&receiver->counts.repeated, 1u);
        return E2E_REPEATED;
    } else if (steps <= max_delta_counter) {
        if (steps > 1u) {
            count(&receiver->counts.lost, (uint8_t)(steps - 1u));
        }
    } else if (!receiver->has_refused ||
               (steps_between(receiver->refused_counter, counter) != 1u)) {
        receiver->refused_counter = counter;
        receiver->has_refused = true;
        if (E2E_COUNTERS - steps <= max_delta_counter) {
            count(&receiver->counts.reordered, 1u);
            return E2E_REORDERED;
        }
        count(&receiver->counts.lost, (uint8_t)(steps - 1u));
        return E2E_WRONG_SEQUENCE;
    }
    receiver->counter = counter;
    receiver->has_refused = false;
    return E2E_OK;
}

e2e_status_t e2e_check(e2e_receiver_t *receiver, const uint8_t *data, uint8_t length,
                       uint8_t expected_length, const uint8_t data_ids[E2E_COUNTERS],
                       uint8_t max_delta_counter)
{
    e2e_status_t status;
    if ((length != expected_length) || (length < E2E_HEADER_LENGTH)) {
        count(&receiver->counts.wrong_length, 1u);
        receiver->is_bad = true;
        status = E2E_WRONG_LENGTH;
    } else if (data[0] != e2e_crc(data, length, data_ids)) {
        count(&receiver->counts.wrong_crc, 1u);
        receiver->is_bad = true;
        status = E2E_WRONG_CRC;
    } else {
        status = check_counter(receiver, data[1] & COUNTER_MASK, max_delta_counter);
    }
    if (status == E2E_OK) {
        receiver->is_good = true;
    } else {
        receiver->is_disturbed = true;
    }
    return status;
}

/* The history with one more period, of which only the window is kept. */
static uint8_t with_period(uint8_t history, bool is_set, uint8_t window_periods)
{
    const uint32_t kept = ((uint32_t)1u << window_periods) - 1u;
    return (uint8_t)((((uint32_t)history << 1u) | (is_set ? 1u : 0u)) & kept);
}

/* Bits of a byte: those of pairs, of fours, and of the whole are added up. */
NUMERIC_INLINE uint32_t periods_in(uint32_t history)
{
    const uint32_t pairs = history - ((history >> 1u) & 0x55u);
    const uint32_t fours = (pairs & 0x33u) + ((pairs >> 2u) & 0x33u);
    return (fours + (fours >> 4u)) & 0x0Fu;
}

/* Whether a valid message has a window of good periods and none that is bad, as it mostly has. */
NUMERIC_INLINE bool is_undisturbed(const e2e_receiver_t *receiver, const e2e_policy_t *policy)
{
    return (receiver->state == E2E_VALID) && (receiver->bad_periods == 0u) &&
           (receiver->good_periods == with_period(UINT8_MAX, true, policy->window_periods)) &&
           (policy->valid.min_good <= policy->window_periods);
}

static e2e_state_t next_state(const e2e_receiver_t *receiver, const e2e_policy_t *policy)
{
    if (is_undisturbed(receiver, policy)) {
        return E2E_VALID;
    }
    const uint32_t good = periods_in(receiver->good_periods);
    const uint32_t bad = periods_in(receiver->bad_periods);
    switch (receiver->state) {
    case E2E_NO_DATA:
        return receiver->has_started ? E2E_INIT : E2E_NO_DATA;
    case E2E_INIT:
        if (bad > policy->init.max_bad) {
            return E2E_INVALID;
        }
        return (good >= policy->init.min_good) ? E2E_VALID : E2E_INIT;
    case E2E_VALID:
        return ((good >= policy->valid.min_good) && (bad <= policy->valid.max_bad)) ? E2E_VALID
                                                                                    : E2E_INVALID;
    default:
        return ((good >= policy->invalid.min_good) && (bad <= policy->invalid.max_bad))
                   ? E2E_VALID
                   : E2E_INVALID;
    }
}

e2e_verdict_t e2e_supervise(e2e_receiver_t *receiver, const e2e_policy_t *policy)
{
    receiver->good_periods =
        with_period(receiver->good_periods, receiver->is_good, policy->window_periods);
    receiver->bad_periods =
        with_period(receiver->bad_periods, receiver->is_bad, policy->window_periods);
    receiver->state = next_state(receiver, policy);
    const e2e_verdict_t verdict = { receiver->is_good && (receiver->state == E2E_VALID),
                                    receiver->is_disturbed };
    receiver->is_good = false;
    receiver->is_bad = false;
    receiver->is_disturbed = false;
    return verdict;
}
