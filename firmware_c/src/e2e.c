#include "e2e.h"

#define CRC8_START 0xFFu
#define CRC8_FINAL_XOR 0xFFu
#define COUNTER_MASK 0x0Fu

/* Remainders of the sixteen values of four bits for polynomial 0x2F. */
static const uint8_t CRC8_OF_HALF_BYTE[16] = {
    0x00u, 0x2Fu, 0x5Eu, 0x71u, 0xBCu, 0x93u, 0xE2u, 0xCDu,
    0x57u, 0x78u, 0x09u, 0x26u, 0xEBu, 0xC4u, 0xB5u, 0x9Au,
};

static uint8_t crc8_byte(uint8_t crc, uint8_t byte)
{
    uint32_t rest = (uint32_t)crc ^ byte;
    rest = ((rest << 4u) & 0xF0u) ^ CRC8_OF_HALF_BYTE[rest >> 4u];
    rest = ((rest << 4u) & 0xF0u) ^ CRC8_OF_HALF_BYTE[rest >> 4u];
    return (uint8_t)rest;
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
        count(&receiver->counts.lost, (uint8_t)(steps - 1u));
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

static uint8_t periods_in(uint8_t history)
{
    uint8_t number = 0u;
    for (uint32_t rest = history; rest != 0u; rest &= rest - 1u) {
        number++;
    }
    return number;
}

static e2e_state_t next_state(const e2e_receiver_t *receiver, const e2e_policy_t *policy)
{
    const uint8_t good = periods_in(receiver->good_periods);
    const uint8_t bad = periods_in(receiver->bad_periods);
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
