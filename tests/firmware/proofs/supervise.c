/* Any period in any state: what is used came in it, of a message that is valid. */
#include "proof.h"

#include "e2e.h"

static uint32_t ones(uint8_t bits)
{
    uint32_t sum = 0u;
    for (uint32_t i = 0u; i < 8u; i++) {
        sum += ((uint32_t)bits >> i) & 1u;
    }
    return sum;
}

int main(void)
{
    ANY(e2e_receiver_t, receiver);
    ANY(e2e_policy_t, policy);
    GRANTED((policy.window_periods >= 1u) && (policy.window_periods <= E2E_LONGEST_WINDOW));
    const e2e_receiver_t before = receiver;
    const e2e_verdict_t verdict = e2e_supervise(&receiver, &policy);
    const uint32_t good = ones(receiver.good_periods);
    const uint32_t bad = ones(receiver.bad_periods);
    HOLDS(!verdict.is_usable || before.is_good, "what is used came in the period");
    HOLDS(!verdict.is_usable || (receiver.state == E2E_VALID), "of a valid message");
    HOLDS(verdict.is_disturbed == before.is_disturbed, "a refused frame is told");
    HOLDS((good <= policy.window_periods) && (bad <= policy.window_periods), "in the window");
    HOLDS((before.state != E2E_VALID) ||
              ((receiver.state == E2E_VALID) ==
               ((good >= policy.valid.min_good) && (bad <= policy.valid.max_bad))),
          "a message stays valid while its window is as the policy wants, by a plain count");
    HOLDS((before.state != E2E_NO_DATA) || (receiver.state != E2E_VALID),
          "no message is valid at its first period");
    HOLDS(!receiver.is_good && !receiver.is_bad && !receiver.is_disturbed, "the next is new");
    return 0;
}
